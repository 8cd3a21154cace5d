//! Bounds of monitored functions along pieces of the step.

use std::cell::RefCell;

use filippov_expr::{Enclosure, Interval, Motion};
use smallvec::SmallVec;

use crate::cube::{enclose_root, EnclosedRoot, IntervalVector, RootBounds, Vector};
use crate::event::certificate::Bound;
use crate::event::tube::{RememberedTube, Tube};
use crate::mode::Signs;
use crate::motion::Monitored;
use crate::motion::{AffineBounds, Guard, KnownMultipliers, RootEnd, Seen};
use crate::page::IS_PAGE;
use crate::stepper::Interpolant;
use crate::system::{PiecewiseSystem, Setting};
use crate::tolerances::{EPS, FEW_SURFACES, ROOT_BOXES};

/// The continuous extension of a step, as far as it bounds what is monitored.
pub(crate) struct BoundedCurve<'a> {
    pub system: &'a dyn PiecewiseSystem,
    /// The system whose normal components end the motion: a reduced one on a surface of higher relative degree.
    pub sliding_system: &'a dyn PiecewiseSystem,
    pub interpolant: &'a Interpolant,
    pub setting: Setting<'a>,
    pub sliding: &'a [usize],
    /// How far the projection onto a curved surface moves the extension.
    pub margin: &'a [f64],
    /// The exit functions of the motion in the step.
    pub seen: &'a [Seen],
    /// Bounds of many multipliers, where the field is affine in the signs.
    pub affine: Option<&'a AffineBounds>,
    /// Which of them are not asked for.
    pub far: &'a [bool],
    /// Whether the exit functions are those of the multipliers of the canopy.
    pub by_multipliers: bool,
    /// The normal components on pieces of this extension: they are asked for one after the other.
    pub known_exits: &'a RefCell<Vec<Piece>>,
    /// The multipliers on the pieces looked at, while sliding on an intersection: all exit functions ask for them.
    pub known_roots: &'a RefCell<Vec<RootPiece>>,
}

/// What stands for a value that is positive and not otherwise known: finite also after it was rounded outwards.
const FAR: f64 = 1e300;

/// Pieces whose multipliers are remembered within a step.
const MOST_KNOWN_ROOTS: usize = 64;

/// A piece with the bounds of both normal components.
pub(crate) type Piece = (f64, f64, [Enclosure; 2]);

/// A piece with the bounds of the multipliers.
pub(crate) type RootPiece = (f64, f64, RootBounds);

impl BoundedCurve<'_> {
    /// The bounds of a function from theta = `a` to `b`, if the system can give any.
    pub fn over(&self, m: &Monitored, a: f64, b: f64) -> Option<Bound> {
        // An exit function is positive inside as it is, that of f+ with its sign changed.
        let (enclosure, orientation) = match (m.guard, self.sliding) {
            (Guard::Surface(j), _) => {
                let tube = Tube::new(self.interpolant, (a, b), self.margin);
                let enclosure = self.system.enclose_surface(j, &tube, self.setting)?;
                (enclosure, m.orientation)
            }
            (Guard::Multiplier { end, .. }, &[j]) => {
                let components = self.normal_components(j, a, b)?;
                (components[m.place], -f64::from(end))
            }
            (guard, _) => return self.exit(guard, a, b),
        };
        Some(Bound::new(enclosure, orientation, self.interpolant.dt))
    }

    /// An exit function of sliding on an intersection, from bounds of the multipliers.
    fn exit(&self, guard: Guard, a: f64, b: f64) -> Option<Bound> {
        let m = self.sliding.len();
        if !self.by_multipliers || m > FEW_SURFACES && self.affine.is_none() {
            return None;
        }
        let mut known = self.known_roots.borrow_mut();
        let place = match known.iter().position(|piece| (piece.0, piece.1) == (a, b)) {
            Some(place) => place,
            None => {
                let piece = (a, b, self.enclosed_root(a, b)?);
                if known.len() == MOST_KNOWN_ROOTS {
                    known.clear();
                }
                known.push(piece);
                known.len() - 1
            }
        };
        match &known[place].2 {
            RootBounds::Proved(root) => {
                let enclosure = exit_bound(guard, self.sliding, root)?;
                Some(Bound::new(enclosure, 1.0, self.interpolant.dt))
            }
            RootBounds::Unproved => Some(Bound::new(Enclosure::UNKNOWN, 1.0, 1.0)),
            RootBounds::Singular => None,
        }
    }

    /// Bounds of the normal components of all fields around the intersection.
    fn all_components(&self, a: f64, b: f64) -> Option<SmallVec<[Interval; 24]>> {
        let tube = Tube::new(self.interpolant, (a, b), self.margin);
        let m = self.sliding.len();
        let mut components = SmallVec::from_elem(Interval::ALL, m << m);
        let mut signs = Signs::from_slice(self.setting.signs);
        for pattern in 0..1_usize << m {
            for (i, &j) in self.sliding.iter().enumerate() {
                signs[j] = if pattern >> i & 1 == 1 { 1.0 } else { -1.0 };
            }
            let below = (0..m).filter(|i| pattern >> i & 1 == 0);
            for i in below {
                let setting = self.setting.with_signs(&signs);
                let sides = self.sliding_system.enclose_normal_components(
                    self.sliding[i],
                    &tube,
                    setting,
                )?;
                components[pattern * m + i] = sides[0].value;
                components[(pattern | 1 << i) * m + i] = sides[1].value;
            }
        }
        Some(components)
    }

    fn normal_components(&self, j: usize, a: f64, b: f64) -> Option<[Enclosure; 2]> {
        if let Some(known) = known_components(&self.known_exits.borrow(), a, b) {
            return Some(known);
        }
        let tube = Tube::new(self.interpolant, (a, b), self.margin);
        let components = self
            .sliding_system
            .enclose_normal_components(j, &tube, self.setting)?;
        self.known_exits.borrow_mut().push((a, b, components));
        Some(components)
    }

    /// The multipliers on a piece, from boxes around their values at the ends of the step.
    fn enclosed_root(&self, a: f64, b: f64) -> Option<RootBounds> {
        if let (Some(bounds), Some(affine)) = (self.affine, self.sliding_system.affine_signs()) {
            let tube = Tube::new(self.interpolant, (a, b), self.margin);
            let remembered;
            let tube: &dyn Motion = match IS_PAGE {
                true => &tube,
                false => {
                    remembered = RememberedTube::new(&tube, self.interpolant.n_states());
                    &remembered
                }
            };
            let exits = || self.seen.chunks_exact(2).take(self.sliding.len());
            let middles = exits().map(|pair| 0.5 * (pair[0].start + pair[0].end) - 1.0);
            let near: Vector = middles.collect();
            // Exit functions with a slack, and those of shared loads, are not those of the multipliers alone.
            let is_plain =
                exits().all(|pair| (pair[0].start + pair[1].start - 2.0).abs() <= 8.0 * EPS);
            let start: Vector = exits().map(|pair| pair[0].start - 1.0).collect();
            let known = KnownMultipliers {
                near: &near,
                start: is_plain.then_some(&start[..]),
                far: self.far,
            };
            let found = bounds.enclose(affine, self.sliding, tube, self.setting, known);
            return Some(found.map_or(RootBounds::Unproved, |found| {
                RootBounds::Proved(EnclosedRoot {
                    multipliers: found.values,
                    rates: found.rates,
                    diagonal: IntervalVector::new(),
                    reserves: found.reserves,
                })
            }));
        }
        let components = self.all_components(a, b)?;
        let exits = self.seen.chunks_exact(2).take(self.sliding.len());
        let ends = exits.map(|pair| Interval::hull(pair[0].start - 1.0, pair[0].end - 1.0));
        let ends: IntervalVector = ends.collect();
        let boxes = ROOT_BOXES.into_iter().map(|radius| {
            let wider = |l: &Interval| Interval::hull(l.lo - radius, l.hi + radius);
            enclose_root(
                &components,
                &ends.iter().map(wider).collect::<IntervalVector>(),
            )
        });
        let mut found = RootBounds::Unproved;
        for bounds in boxes {
            found = bounds;
            if !matches!(found, RootBounds::Unproved) {
                break;
            }
        }
        Some(found)
    }
}

/// Do bounds of the multipliers that another guard has asked for show that one has no zero up to `reach`?
pub(crate) fn is_known_clear(m: &Monitored, known: &[RootPiece], reach: f64) -> bool {
    if IS_PAGE {
        return false;
    }
    let (Guard::Multiplier { end, .. }, Some((a, b, bounds))) = (m.guard, known.first()) else {
        return false;
    };
    let (is_piece, position) = ((*a, *b) == (0.0, reach), m.place / 2);
    match bounds {
        RootBounds::Proved(root) if is_piece && position < root.multipliers.len() => {
            let multiplier = root.multipliers[position];
            let nearest = if end > 0 {
                multiplier.hi
            } else {
                -multiplier.lo
            };
            1.0 - nearest > m.noise + EPS
        }
        _ => false,
    }
}

/// The bounds over a piece that was looked at, or over two that make it up.
fn known_components(known: &[Piece], a: f64, b: f64) -> Option<[Enclosure; 2]> {
    if let Some(piece) = known.iter().find(|piece| (piece.0, piece.1) == (a, b)) {
        return Some(piece.2);
    }
    let first = known.iter().find(|piece| piece.0 == a && piece.1 < b)?;
    let second = known
        .iter()
        .find(|piece| (piece.0, piece.1) == (first.1, b))?;
    Some([0, 1].map(|k| first.2[k].hull(second.2[k])))
}

/// Bounds of an exit function where the multipliers are bounded; none for the stability of three and more.
fn exit_bound(guard: Guard, sliding: &[usize], root: &EnclosedRoot) -> Option<Enclosure> {
    let mut rate = Interval::ALL;
    let value = match guard {
        Guard::Multiplier { surface, end } => {
            let position = sliding.binary_search(&surface).ok()?;
            if let Some(reserve) = root.reserves.get(position).copied().flatten() {
                return Some(reserve);
            }
            if let Some(bounds) = root.rates.get(position) {
                rate = bounds.scaled(-f64::from(end));
            }
            Interval::point(1.0) + root.multipliers[position].scaled(-f64::from(end))
        }
        // The root is the only one in its box: it meets no other.
        Guard::Root(RootEnd::Fold) => Interval::point(FAR),
        // Each entry is in units of its surface: only the sign counts.
        Guard::Root(RootEnd::Stability) => match root.diagonal[..] {
            [] => Interval::point(FAR),
            [first, second] => Interval::hull(-first.hi.min(second.hi), FAR),
            _ => return None,
        },
        Guard::Surface(_) | Guard::Force(_) => return None,
    };
    Some(Enclosure { value, rate })
}
