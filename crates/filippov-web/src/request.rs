//! Requests: fields of a JSON object, read with messages that name them.

use serde_json::{Map, Value};

use crate::model::Model;
use crate::refusal::Refusal;

/// A JSON object under reading, and where it stands in the request.
#[derive(Clone, Copy)]
pub struct Request<'a> {
    fields: &'a Map<String, Value>,
    prefix: &'static str,
}

impl<'a> Request<'a> {
    /// The request that a value is.
    ///
    /// # Errors
    /// If it is no JSON object.
    pub fn new(value: &'a Value) -> Result<Self, Refusal> {
        let fields = value.as_object();
        let fields = fields.ok_or_else(|| Refusal::request("a request is a JSON object"))?;
        Ok(Request { fields, prefix: "" })
    }

    /// The section of a page, read as requests are.
    pub fn page(model: &'a Model) -> Self {
        Request {
            fields: &model.description.page,
            prefix: "PAGE.",
        }
    }

    /// A field, `None` if it is absent or `null`.
    pub fn get(&self, name: &str) -> Option<&'a Value> {
        self.fields.get(name).filter(|value| !value.is_null())
    }

    /// The error that a field is missing or wrong.
    pub fn wrong(&self, name: &str, requirement: &str) -> Refusal {
        Refusal::request(format!("{}{name}: {requirement}", self.prefix))
    }

    /// An object in a field.
    pub fn object(&self, name: &'static str) -> Result<Option<Request<'a>>, Refusal> {
        let Some(value) = self.get(name) else {
            return Ok(None);
        };
        let fields = value.as_object();
        let fields = fields.ok_or_else(|| self.wrong(name, "an object is needed"))?;
        Ok(Some(Request {
            fields,
            prefix: match name {
                "section" => "section.",
                "ranges" => "PAGE.ranges.",
                "params" => "params.",
                _ => "",
            },
        }))
    }

    /// The names and values of an object.
    pub fn entries(&self) -> impl Iterator<Item = (&'a String, &'a Value)> {
        self.fields.iter()
    }

    /// A number.
    pub fn number(&self, name: &str) -> Result<Option<f64>, Refusal> {
        let number = |value: &Value| {
            let number = value.as_f64().filter(|number| number.is_finite());
            number.ok_or_else(|| self.wrong(name, "a finite number is needed"))
        };
        self.get(name).map(number).transpose()
    }

    /// A whole number from 0 to `most`.
    pub fn count(&self, name: &str, most: u64) -> Result<Option<u64>, Refusal> {
        let count = |value: &Value| {
            let whole = |number: f64| {
                let is_whole = number.fract() == 0.0 && (0.0..=most as f64).contains(&number);
                is_whole.then_some(number as u64)
            };
            let count = value.as_u64().filter(|&count| count <= most);
            let count = count.or_else(|| value.as_f64().and_then(whole));
            let requirement = || format!("a whole number from 0 to {most} is needed");
            count.ok_or_else(|| self.wrong(name, &requirement()))
        };
        self.get(name).map(count).transpose()
    }

    /// A text.
    pub fn text(&self, name: &str) -> Result<Option<&'a str>, Refusal> {
        let text = |value: &'a Value| {
            let text = value.as_str();
            text.ok_or_else(|| self.wrong(name, "a text is needed"))
        };
        self.get(name).map(text).transpose()
    }

    /// Yes or no.
    pub fn flag(&self, name: &str) -> Result<Option<bool>, Refusal> {
        let flag = |value: &Value| {
            let flag = value.as_bool();
            flag.ok_or_else(|| self.wrong(name, "true or false is needed"))
        };
        self.get(name).map(flag).transpose()
    }

    /// A list of finite numbers.
    pub fn numbers(&self, name: &str) -> Result<Option<Vec<f64>>, Refusal> {
        let Some(value) = self.get(name) else {
            return Ok(None);
        };
        let finite = |entry: &Value| entry.as_f64().filter(|number| number.is_finite());
        let numbers = value
            .as_array()
            .and_then(|list| list.iter().map(finite).collect::<Option<Vec<f64>>>());
        let numbers =
            numbers.ok_or_else(|| self.wrong(name, "a list of finite numbers is needed"))?;
        Ok(Some(numbers))
    }

    /// So many finite numbers.
    pub fn exactly<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>, Refusal> {
        let Some(numbers) = self.numbers(name)? else {
            return Ok(None);
        };
        let found = numbers.len();
        let numbers = numbers.try_into();
        let requirement = || format!("{N} numbers are needed, there are {found}");
        let numbers = numbers.map_err(|_| self.wrong(name, &requirement()))?;
        Ok(Some(numbers))
    }

    /// An index below the number of `names`, or one of them.
    pub fn choice(&self, name: &str, names: &[String]) -> Result<Option<usize>, Refusal> {
        let Some(value) = self.get(name) else {
            return Ok(None);
        };
        let found = match value {
            Value::String(text) => names.iter().position(|known| known == text),
            _ => value
                .as_u64()
                .map(|index| index as usize)
                .filter(|&index| index < names.len()),
        };
        let requirement = || {
            let known = names.join(", ");
            format!("{value} is none of {known} (a name, or an index from 0)")
        };
        let found = found.ok_or_else(|| self.wrong(name, &requirement()))?;
        Ok(Some(found))
    }

    /// The value of a field that must be there.
    pub fn needed<T>(&self, name: &str, value: Option<T>) -> Result<T, Refusal> {
        value.ok_or_else(|| self.wrong(name, "is missing"))
    }
}
