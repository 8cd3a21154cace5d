//! The phase plane: surfaces and what the fields do at them, directions, equilibria.

use serde_json::{json, Value};

use crate::dimensions::Window;
use crate::equilibria::equilibria;
use crate::model::Model;
use crate::refusal::Refusal;
use crate::reply::Reply;
use crate::request::Request;
use crate::run_request::params_of;
use crate::sheet::Plane;

/// Cells along each side in which surfaces are looked for, and arrows along each side.
const CELLS: usize = 64;
const ARROWS: u64 = 20;
const MOST_ARROWS: u64 = 200;

/// What is looked for, in words.
const SEARCHED: &str = "Equilibria were looked for by Newton's method from many starts: in the regions seen here, on each surface, \
    and where surfaces meet. There may be others.";

pub fn portrait(model: &Model, request: &Request) -> Result<Reply, Refusal> {
    if model.n() < 2 {
        return Err(Refusal::request("portrait: the model has one state only"));
    }
    let window = Window::read(model, request, CELLS)?;
    let params = params_of(model, request)?;
    let t = request.number("t")?.unwrap_or(0.0);
    let n_arrows = request.count("arrows", MOST_ARROWS)?.unwrap_or(ARROWS) as usize;
    let ready = model.ready(&params, t, &window.rest)?;
    let (system, actions) = (ready.system(), ready.actions());
    let plane = Plane {
        system,
        window: &window,
        t,
        q: &actions.discrete,
    };
    let sheets = plane.sheets(model.n_visible())?;
    let mut points = Vec::new();
    let mut parts: Vec<Value> = Vec::new();
    for part in &sheets {
        let first = points.len() / 2;
        points.extend(part.points.iter().flat_map(|at| at.point));
        parts.push(json!({
            "surface": model.surface(part.surface),
            "kind": part.kind.name(),
            "first": first,
            "last": points.len() / 2 - 1,
        }));
    }
    let mut field = Vec::new();
    for row in 0..n_arrows {
        for column in 0..n_arrows {
            let at = window.centre(column, row, n_arrows);
            let along = plane.field(at)?;
            field.extend([at[0], at[1], along[0], along[1]]);
        }
    }
    let mut reply = Reply::new("portrait");
    let resting = match system.depends_on_time() {
        true => {
            reply.set(
                "note",
                "the field depends on the time: it has no equilibria",
            );
            Vec::new()
        }
        false => equilibria(&plane, &sheets, model.n_visible())?,
    };
    let resting = resting.iter().map(|point| {
        let surfaces = point.surfaces.iter().map(|&j| model.surface(j));
        json!({
            "y": point.y,
            "surfaces": surfaces.collect::<Vec<_>>(),
            "stable": point.is_stable,
            "admissible": point.is_admissible,
        })
    });
    reply.set("searched", SEARCHED);
    reply.set("equilibria", resting.collect::<Vec<Value>>());
    reply.set("parts", parts);
    reply.array("points", &[points.len() / 2, 2], &points);
    reply.array("field", &[field.len() / 4, 4], &field);
    Ok(reply)
}
