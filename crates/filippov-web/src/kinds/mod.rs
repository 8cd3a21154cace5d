//! The kinds of request, one per file.

mod basins;
mod describe;
mod diagram;
mod portrait;
mod run;
mod sample;
mod section;

use crate::model::Model;
use crate::refusal::Refusal;
use crate::reply::Reply;
use crate::request::Request;

type Answerer = fn(&Model, &Request) -> Result<Reply, Refusal>;

/// All kinds by name.
pub const ALL: [(&str, Answerer); 8] = [
    ("describe", describe::describe),
    ("run", run::run),
    ("sample", sample::sample),
    ("section", section::section),
    ("diagram", diagram::diagram),
    ("portrait", portrait::portrait),
    ("ends", basins::ends),
    ("basins", basins::basins),
];
