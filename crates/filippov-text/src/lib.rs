//! Right-hand sides typed as Python text: the same expressions as tracing the function gives, without Python.
//!
//! The model is the only system of the text, `@fl.system` or `fl.System(...)`, or the function with the name `rhs`, or the last
//! function. Arguments with a number as default are parameters. States without names have those of the first unpacking, `y, v = x`.
//! Read are imports, functions and lambdas, assignments, loops over lists, comprehensions, arithmetic, arrays with one or two axes,
//! functions of NumPy and `math`, comparisons, `if` with any branches, floors, clocks, tables, the laws of the package, and resets.
//! Everything else is refused by name, with its line and column: a model is never read as something that Python would not compute.
//!
//! As in tracing, the function is followed once for every combination of answers to its comparisons.
//!
//! ```
//! let text = "def oscillator(t, x, F=0.4):\n    y, v = x\n    return v, -y - F * np.sign(v)\n";
//! let model = filippov_text::read(text)?;
//! assert_eq!(model.system.definition.names.states, ["y", "v"]);
//! assert_eq!(model.system.defaults, [0.4]);
//!
//! let refused = filippov_text::read("def f(t, x):\n    return open(x)\n").unwrap_err();
//! assert_eq!((refused.line, refused.column), (2, 12));
//! # Ok::<(), filippov_text::Unreadable>(())
//! ```

#[cfg(target_arch = "wasm32")]
mod abi;
mod arrays;
mod calls;
mod constants_of_motion;
mod expressions;
mod laws;
mod model;
mod module;
mod numpy;
mod parts;
mod questions;
mod reader;
mod reply;
mod statements;
mod tables;
mod tracer;
mod unreadable;
mod values;

pub use module::{read, TextModel};
pub use reply::reply;
pub use unreadable::Unreadable;
