//! Replies: a header in JSON and arrays of numbers.

use serde_json::{json, Map, Value};

use crate::refusal::Refusal;

/// A reply that is being made.
pub struct Reply {
    header: Map<String, Value>,
    arrays: Map<String, Value>,
    numbers: Vec<f64>,
}

impl Reply {
    /// A reply without arrays to a request of this kind.
    pub fn new(kind: &str) -> Self {
        let mut header = Map::new();
        header.insert("ok".into(), true.into());
        header.insert("kind".into(), kind.into());
        Reply {
            header,
            arrays: Map::new(),
            numbers: Vec::new(),
        }
    }

    /// Adds an entry to the header. Numbers that are not finite become `null`: JSON has none.
    pub fn set(&mut self, name: &str, value: impl Into<Value>) {
        self.header.insert(name.into(), value.into());
    }

    /// Adds an array.
    pub fn array(&mut self, name: &str, shape: &[usize], values: &[f64]) {
        debug_assert_eq!(shape.iter().product::<usize>(), values.len(), "{name}");
        self.arrays
            .insert(name.into(), json!([self.numbers.len(), shape]));
        self.numbers.extend_from_slice(values);
    }

    /// The bytes.
    pub fn into_bytes(mut self) -> Vec<u8> {
        self.header.insert("arrays".into(), self.arrays.into());
        packed(&self.header.into(), &self.numbers)
    }
}

/// The bytes of a failure.
pub fn failure(refusal: &Refusal) -> Vec<u8> {
    let header = json!({"ok": false, "error": refusal.text, "code": refusal.code, "arrays": {}});
    packed(&header, &[])
}

fn packed(header: &Value, numbers: &[f64]) -> Vec<u8> {
    let text = header.to_string();
    let begin = (4 + text.len()).next_multiple_of(8);
    let mut bytes = Vec::with_capacity(begin + 8 * numbers.len());
    bytes.extend((text.len() as u32).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.resize(begin, 0);
    bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    bytes
}
