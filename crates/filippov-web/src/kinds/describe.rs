//! What a model is.

use serde_json::{json, Value};

use crate::model::Model;
use crate::refusal::Refusal;
use crate::reply::Reply;
use crate::request::Request;

pub fn describe(model: &Model, _: &Request) -> Result<Reply, Refusal> {
    let known = &model.description;
    let params = known.params.iter();
    let params: Vec<Value> = params
        .map(|param| json!({"name": param.name, "value": param.value}))
        .collect();
    let mut reply = Reply::new("describe");
    reply.set("n", model.n());
    reply.set("states", known.states.clone());
    reply.set("params", params);
    reply.set("pinned", known.is_pinned);
    reply.set("surfaces", known.surfaces.clone());
    reply.set("actions", known.actions.clone());
    reply.set("discrete", known.discrete.clone());
    reply.set("page", known.page.clone());
    reply.set("version", env!("CARGO_PKG_VERSION"));
    Ok(reply)
}
