//! The engine of the interactive page: everything that it computes, for every host.
//!
//! A [`Model`] is read from bytes once. [`answer`] takes a request in JSON and returns a reply: a header in JSON and arrays of
//! numbers behind it. Hosts draw and compute nothing, so a page, a notebook and a terminal show the same numbers.
//!
//! A reply is, in this order, the length of the header (4 bytes, little endian), the header, zeros up to a multiple of 8 bytes,
//! and the arrays as 64-bit floating point numbers, little endian. The header has `ok`, `kind` and, under `arrays`, for each
//! name the offset of an array, counted in numbers, and its shape. A failure has `ok` false, an `error` sentence and a `code`.
//!
//! # Example
//! ```
//! use filippov::{Definition, SavedSystem};
//! use filippov_expr::{Graph, Names};
//! use filippov_web::{answer, Model};
//!
//! let mut graph = Graph::new();
//! let x = graph.state(0);
//! let sign = graph.sign(x);
//! let field = vec![graph.neg(sign)];
//! let names = Names { states: vec!["x".into()], parameters: vec![] };
//! let definition = Definition { graph, field, names, rules: Default::default() };
//! let relay = SavedSystem { definition, ..SavedSystem::default() };
//!
//! let model = Model::from_bytes(&relay.to_bytes())?;
//! let reply = answer(&model, br#"{"kind": "run", "t_span": [0, 2], "y0": [1]}"#);
//! let length = u32::from_le_bytes([reply[0], reply[1], reply[2], reply[3]]) as usize;
//! let header: serde_json::Value = serde_json::from_slice(&reply[4..4 + length])?;
//! assert_eq!(header["switches"][0]["kind"], "enter_sliding");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(target_arch = "wasm32")]
pub mod abi;
mod answer;
mod clusters;
mod curve;
mod dimensions;
mod equilibria;
mod kinds;
mod model;
mod refusal;
mod reply;
mod request;
mod run_request;
mod section_request;
mod sheet;
mod words;

pub use answer::answer;
pub use model::{pack, unpack, Description, Model, Parameter, Ready, Source};
pub use refusal::Refusal;
