//! Questions of a trace that the core may not answer as Python does are refused, as `python/filippov/trace/questions.py` does.
//! Where Python only doubts and warns, this refuses too: a page has no place for such a warning.

use filippov_expr::{Edge, NodeId, Switching};

use crate::tracer::{Kind, Tracer};
use crate::unreadable::{refuse, Refused};

/// Refuses a floor or a relay of what jumps, a surface that ends or is singular on another one, and comparisons of which it was
/// not found out whether they are decided like those of Python.
pub fn check_questions(
    tracer: &mut Tracer,
    field: &[NodeId],
    watched: &[u32],
    n_hidden: usize,
) -> Result<(), Refused> {
    if tracer.questions.is_empty() {
        return Ok(());
    }
    let mut regions = tracer.regions();
    let open = vec![None; regions.graph().n_surfaces()];
    let triggers = watched
        .iter()
        .map(|&surface| regions.function(surface, &open));
    let mut roots: Vec<NodeId> = triggers.collect();
    roots.splice(0..0, field.iter().copied());
    roots.extend(tracer.laws.arguments());
    for question in &tracer.questions {
        if !matches!(question.kind, Kind::Quantiser | Kind::Hysteresis) {
            continue;
        }
        if regions.jumps_at(question.node).is_some() {
            let error = "a floor, a table or a relay of what jumps: whole numbers or thresholds that it jumps over would be missed";
            return refuse(&question.place, error);
        }
    }
    let mut surface_of = Vec::new();
    for question in &tracer.questions {
        surface_of.push(match regions.question(question.node).1 {
            Switching::Surface { index, .. } => Some(index),
            Switching::Constant(_) => None,
        });
    }
    let open = vec![None; regions.graph().n_surfaces()];
    for (question, surface) in tracer.questions.iter().zip(&surface_of) {
        if !tracer.unresolved.contains(&question.node) {
            continue;
        }
        if surface.is_none_or(|surface| regions.matters(&roots, &open, surface)) {
            let error =
                "whether this is 0 in some region is not found out: it has too many signs inside";
            return refuse(&question.place, error);
        }
    }
    for surface in 0..tracer.graph.n_surfaces() - n_hidden {
        let surface = surface as u32;
        let function = regions.function(surface, &open);
        let Some(edge) = regions.edge(function) else {
            continue;
        };
        if !regions.matters(&roots, &open, surface) {
            continue;
        }
        let of_surface = surface_of.iter().position(|of| *of == Some(surface));
        let place = of_surface.map_or(tracer.place, |index| tracer.questions[index].place);
        let what = match edge {
            Edge::Singular(_) => "has a pole or a vertical tangent",
            Edge::Domain(_) => "may end",
        };
        let error = format!(
            "a comparison of what {what} where a sign inside of it changes: compare the argument itself"
        );
        return refuse(&place, error);
    }
    tracer.is_pinned |= regions.used_parameters();
    Ok(())
}

/// Do expressions have Python's values at every point? And if, for these parameters only?
pub fn is_exact_at_an_instant(tracer: &Tracer, nodes: &[NodeId]) -> (bool, bool) {
    if !tracer.laws.is_empty() || tracer.has_pieces {
        return (false, false);
    }
    let mut regions = tracer.regions();
    let mut differs = false;
    for question in &tracer.questions {
        let (node, switching) = regions.question(question.node);
        let sign = match switching {
            Switching::Constant(sign) => {
                if regions.graph().as_constant(node).is_none() {
                    return (false, false);
                }
                sign
            }
            Switching::Surface { orientation, .. } => orientation,
        };
        differs |= match question.kind {
            Kind::Comparison { is_strict } => (sign > 0.0) == is_strict,
            _ => true,
        };
    }
    let is_exact = !differs || nodes.iter().all(|&node| regions.jumps_at(node).is_none());
    (is_exact, regions.used_parameters())
}
