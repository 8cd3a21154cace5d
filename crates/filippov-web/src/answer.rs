//! From a request to its reply.

use serde_json::Value;

use crate::kinds;
use crate::model::Model;
use crate::refusal::Refusal;
use crate::reply::{failure, Reply};
use crate::request::Request;

/// The reply to a request: never a panic, and an error in words for everything that is wrong.
pub fn answer(model: &Model, request: &[u8]) -> Vec<u8> {
    match reply_to(model, request) {
        Ok(reply) => reply.into_bytes(),
        Err(refusal) => failure(&refusal),
    }
}

fn reply_to(model: &Model, request: &[u8]) -> Result<Reply, Refusal> {
    let unreadable = |error| Refusal::request(format!("the request is no JSON: {error}"));
    let value: Value = serde_json::from_slice(request).map_err(unreadable)?;
    let request = Request::new(&value)?;
    let kind = request.needed("kind", request.text("kind")?)?;
    let known = kinds::ALL.iter().find(|(name, _)| *name == kind);
    let Some((_, reply)) = known else {
        let names: Vec<&str> = kinds::ALL.iter().map(|(name, _)| *name).collect();
        let requirement = format!("{kind:?} is none of {}", names.join(", "));
        return Err(request.wrong("kind", &requirement));
    };
    reply(model, &request)
}
