//! Comparisons with a quantity that is identically zero in some region: put together from those of its pieces.

use std::rc::Rc;

use filippov_expr::{NodeId, PartSign, Pieces};

use crate::tracer::Tracer;
use crate::unreadable::Refused;
use crate::values::{Answer, Condition};

/// The condition that a quantity is positive, or not negative.
pub fn condition_of(
    tracer: &mut Tracer,
    pieces: &Pieces,
    is_strict: bool,
) -> Result<Answer, Refused> {
    by_sides(pieces, &mut |node, sign| match sign {
        PartSign::Known(sign) => Ok(Answer::Known(sign > 0.0 || sign == 0.0 && !is_strict)),
        _ => tracer.compare(node, is_strict),
    })
}

/// The condition that a quantity is zero; `None` if that is so at single points only.
pub fn equality_of(tracer: &mut Tracer, pieces: &Pieces) -> Result<Option<Answer>, Refused> {
    let parts = parts_of(pieces);
    if parts.iter().any(|(_, sign)| *sign == PartSign::Open) {
        return Ok(None);
    }
    let answer = by_sides(pieces, &mut |node, sign| match sign {
        PartSign::Known(sign) => Ok(Answer::Known(sign == 0.0)),
        _ => tracer.is_held_at_zero(node),
    })?;
    Ok(Some(answer))
}

/// The sign of a quantity.
pub fn sign_of(tracer: &mut Tracer, pieces: &Pieces) -> Result<NodeId, Refused> {
    by_parts(tracer, pieces, &mut |tracer, node, sign| match sign {
        PartSign::Known(sign) => Ok(tracer.graph.constant(sign)),
        _ => tracer.sign(node),
    })
}

type OfPart<'a> = dyn FnMut(&mut Tracer, NodeId, PartSign) -> Result<NodeId, Refused> + 'a;

/// A function of a quantity that is given on its parts.
pub fn by_parts(
    tracer: &mut Tracer,
    pieces: &Pieces,
    function: &mut OfPart,
) -> Result<NodeId, Refused> {
    match pieces {
        Pieces::Part(node, sign) => function(tracer, *node, *sign),
        Pieces::Sides(surface, sides) => {
            let plus = by_parts(tracer, &sides[0], function)?;
            let minus = by_parts(tracer, &sides[1], function)?;
            Ok(tracer.graph.select(*surface, 1.0, plus, minus))
        }
    }
}

/// Does a quantity stand still in some region?
pub fn has_constant_part(tracer: &Tracer, pieces: &Pieces) -> bool {
    let parts = parts_of(pieces).into_iter();
    parts
        .map(|(node, _)| node)
        .any(|node| !tracer.graph.depends_on_motion(node))
}

/// Are the signs of all parts 0 or 1?
pub fn has_known_signs_alone(pieces: &Pieces) -> bool {
    let is_one =
        |sign: &PartSign| matches!(sign, PartSign::Known(sign) if *sign == 0.0 || *sign == 1.0);
    parts_of(pieces).iter().all(|(_, sign)| is_one(sign))
}

/// The expressions of the parts with what is known of their signs.
pub fn parts_of(pieces: &Pieces) -> Vec<(NodeId, PartSign)> {
    match pieces {
        Pieces::Part(node, sign) => vec![(*node, *sign)],
        Pieces::Sides(_, sides) => sides.iter().flat_map(parts_of).collect(),
    }
}

fn by_sides(
    pieces: &Pieces,
    answer: &mut dyn FnMut(NodeId, PartSign) -> Result<Answer, Refused>,
) -> Result<Answer, Refused> {
    match pieces {
        Pieces::Part(node, sign) => answer(*node, *sign),
        Pieces::Sides(surface, sides) => {
            let plus = by_sides(&sides[0], answer)?;
            let minus = by_sides(&sides[1], answer)?;
            Ok(match (&plus, &minus) {
                (Answer::Known(a), Answer::Known(b)) if a == b => plus,
                _ => Answer::Open(Rc::new(Condition::BySide {
                    surface: *surface,
                    plus,
                    minus,
                })),
            })
        }
    }
}
