//! What every request for a run has: a start, a span, parameters, options.

use filippov::{Keep, Method, Options};
use serde_json::Value;

use crate::model::Model;
use crate::refusal::Refusal;
use crate::request::Request;

/// Most steps and switches of a run, unless the request has others: a page must stay responsive.
const MAX_STEPS: u64 = 200_000;
const MAX_EVENTS: u64 = 100_000;
const MOST_STEPS: u64 = 1_000_000_000;

/// A run that is asked for.
#[derive(Clone)]
pub struct RunRequest {
    pub y0: Vec<f64>,
    pub t_span: (f64, f64),
    pub params: Vec<f64>,
    pub options: Options,
}

impl RunRequest {
    /// Reads a request; what it lacks has the values of the page.
    pub fn read(model: &Model, request: &Request, keep: Keep) -> Result<Self, Refusal> {
        let page = Request::page(model);
        let y0 = match start_of(model, request)? {
            Some(y0) => Some(y0),
            None => start_of(model, &page)?,
        };
        let y0 = request.needed("y0", y0)?;
        let span = match request.exactly::<2>("t_span")? {
            Some(span) => Some(span),
            None => page.exactly::<2>("t_span")?,
        };
        let [t0, t1] = request.needed("t_span", span)?;
        Ok(RunRequest {
            y0,
            t_span: (t0, t1),
            params: params_of(model, request)?,
            options: options_of(&page, request, keep)?,
        })
    }
}

/// The start in a request or in the section of a page: a number for each state.
pub fn start_of(model: &Model, request: &Request) -> Result<Option<Vec<f64>>, Refusal> {
    let found = request.numbers("y0")?;
    match &found {
        Some(y0) if y0.len() != model.n() => {
            let names = model.description.states.join(", ");
            let (given, n) = (y0.len(), model.n());
            let requirement =
                format!("{n} numbers are needed, one for each of {names}; there are {given}");
            Err(request.wrong("y0", &requirement))
        }
        _ => Ok(found),
    }
}

/// The values of all parameters: those of the request, the defaults for the others.
pub fn params_of(model: &Model, request: &Request) -> Result<Vec<f64>, Refusal> {
    let known = &model.description.params;
    let mut values: Vec<f64> = known.iter().map(|param| param.value).collect();
    let Some(given) = request.object("params")? else {
        return Ok(values);
    };
    for (name, value) in given.entries() {
        let Some(index) = known.iter().position(|param| param.name == *name) else {
            let names: Vec<&str> = known.iter().map(|param| &*param.name).collect();
            let requirement = format!("no such parameter; there are {}", names.join(", "));
            return Err(given.wrong(name, &requirement));
        };
        let value = value.as_f64().filter(|value| value.is_finite());
        let value = value.ok_or_else(|| given.wrong(name, "a finite number is needed"))?;
        if model.description.is_pinned && value != values[index] {
            let requirement = format!(
                "the model was traced for the value {} and holds for no other",
                values[index]
            );
            return Err(given.wrong(name, &requirement));
        }
        values[index] = value;
    }
    Ok(values)
}

fn options_of(page: &Request, request: &Request, keep: Keep) -> Result<Options, Refusal> {
    let defaults = Options::default();
    let number = |name| match request.number(name) {
        Ok(None) => page.number(name),
        found => found,
    };
    let atol = match request.get("atol").or_else(|| page.get("atol")) {
        Some(Value::Array(_)) => match request.get("atol") {
            Some(_) => request.numbers("atol")?,
            None => page.numbers("atol")?,
        },
        _ => number("atol")?.map(|atol| vec![atol]),
    };
    let method = match request.text("method")? {
        Some(name) => Some(name),
        None => page.text("method")?,
    };
    let method = method.map_or(Ok(Method::Auto), |name| {
        let known = Method::ALL.into_iter().find(|method| method.name() == name);
        let names = Method::ALL.map(Method::name).join(", ");
        known.ok_or_else(|| request.wrong("method", &format!("{name:?} is none of {names}")))
    })?;
    let limit = |name, default| -> Result<u64, Refusal> {
        Ok(request.count(name, MOST_STEPS)?.unwrap_or(default))
    };
    Ok(Options {
        method,
        rtol: number("rtol")?.unwrap_or(defaults.rtol),
        atol: atol.unwrap_or(defaults.atol.clone()),
        max_steps: limit("max_steps", MAX_STEPS)?,
        max_events: limit("max_events", MAX_EVENTS)?,
        dense_output: keep == Keep::Steps,
        keep,
        ..defaults
    })
}
