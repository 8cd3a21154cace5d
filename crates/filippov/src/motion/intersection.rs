//! The sliding field on an intersection of surfaces.

use filippov_expr::sort_few;
use smallvec::SmallVec;

use super::canopy::RootWatch;
use super::guard::Guards;
use super::weights::RuleFailure;
use super::{
    AffineLaw, Canopy, Guard, MeetingFields, Motion, Projector, RootEnd, RuleLaw, SmoothField,
};
use crate::error::FieldError;
use crate::error_scale::Units;
use crate::mode::Mode;
use crate::options::SlidingRule;
use crate::page::IS_PAGE;
use crate::patience::Patience;
use crate::sparse::SparseRows;
use crate::system::{OwnSetting, PiecewiseSystem, Setting};
use crate::tolerances::{AT_SIDE, HELD_AFTER, MOST_MEETING, MOST_TRACKED};

/// Multipliers with their time.
type Dated = (f64, Vec<f64>);

/// Filippov's field on an intersection of m >= 2 surfaces: the multilinear combination ("canopy") of the
/// fields around it with the multipliers lambda in [-1, 1]^m that make it tangent to all surfaces,
///
///   f_s = sum over k of prod_i (1 + k_i lambda_i)/2 * f^k,   grad h_j . f_s + d_t h_j = 0,
///
/// evaluated at the projection of the point onto the intersection. Where the fields are affine in the signs the
/// multipliers are the solution of one linear system; else, for two surfaces, the root with det G > 0 in closed form;
/// for more they are tracked by Newton's method.
///
/// Reference: Guglielmi, Hairer (2022), sections 2, 4 and 7; `docs/theory/intersections.md`.
#[derive(Clone)]
pub struct IntersectionField<'a> {
    system: &'a dyn PiecewiseSystem,
    set: Vec<usize>,
    setting: OwnSetting,
    affine: Option<AffineLaw<'a>>,
    /// Its space grows as the square of the number of surfaces: where there are many, only what needs it has it.
    has_canopy: bool,
    /// That of the set, once it was asked for.
    canopy: Option<Canopy>,
    /// The scaling of the surfaces.
    kappa: Vec<f64>,
    /// Another combination of the fields, if that was chosen.
    by_rule: Option<RuleLaw>,
    /// Why there is none, if one was chosen.
    refused: Option<RuleFailure>,
    /// At the last evaluation; none where there is no root.
    lambda: Vec<f64>,
    /// Those that the motion has come to, with their time; those it begins with, or none, at an endless one.
    reached: Dated,
    /// Those that were found beyond it: from the nearest of all these the next are tracked.
    tracked: Vec<Dated>,
    exits: Vec<f64>,
    /// The times from and to which given multipliers hold: the equations vanish at the start.
    start: Option<([f64; 2], Vec<f64>)>,
    is_rootless: bool,
    /// How far multipliers may go beyond their ends, by exit function.
    slack: Vec<f64>,
    /// When the root of three and more surfaces ends.
    watch: RootWatch,
    projector: Projector,
    /// The factor of the term that draws the motion back, in place of the projection.
    restoring: Option<f64>,
    /// The sizes of the states.
    units: Units<'a>,
    /// How long a search for the first multipliers may take.
    patience: Patience<'a>,
    n_evaluations: u64,
}

impl<'a> IntersectionField<'a> {
    /// Sliding on the surfaces of `set`, the others with the given signs, at these discrete states; the multipliers are tracked from
    /// `lambda`, or found anew if that is empty. If the signs of more than [`MOST_MEETING`] of them multiply one
    /// another there are no multipliers.
    pub fn new(
        system: &'a dyn PiecewiseSystem,
        set: &[usize],
        setting: Setting<'_>,
        lambda: &[f64],
    ) -> Self {
        let affine = AffineLaw::new(system, set, setting);
        let has_canopy = match affine {
            Some(_) => set.len() <= MOST_MEETING,
            None => {
                let groups = system.sign_groups(set);
                groups.iter().all(|group| group.len() <= MOST_MEETING)
            }
        };
        IntersectionField {
            system,
            set: set.to_vec(),
            setting: OwnSetting::new(setting),
            affine,
            has_canopy,
            canopy: None,
            kappa: vec![1.0; set.len()],
            by_rule: None,
            refused: None,
            lambda: Vec::new(),
            reached: (f64::INFINITY, lambda.to_vec()),
            tracked: Vec::new(),
            exits: vec![f64::NAN; 2 * set.len() + 2],
            start: None,
            is_rootless: false,
            slack: vec![0.0; 2 * set.len()],
            watch: RootWatch::default(),
            projector: Projector::new(system.n_states(), system.n_surfaces()),
            restoring: None,
            units: Units::ONES,
            patience: Patience::endless(),
            n_evaluations: 0,
        }
    }

    /// The same with another combination of the fields, of up to [`MOST_MEETING`] surfaces; of more there is one only
    /// where the field is affine in the signs, so that all rules but that of Dieci and Lopez are the canopy.
    #[must_use]
    pub fn with_rule(mut self, rule: SlidingRule) -> Self {
        let m = self.set.len();
        if rule == SlidingRule::Canopy {
            return self;
        }
        if m <= MOST_MEETING {
            self.by_rule = Some(RuleLaw::new(self.system, &self.set, rule));
        } else if self.affine.is_none() || rule == SlidingRule::DieciLopez {
            self.refused = Some(match rule {
                SlidingRule::Moments => RuleFailure::NotTwoSurfaces { m },
                _ => RuleFailure::TooManySurfaces { m },
            });
        }
        self
    }

    /// The search for its first multipliers ends without any when the caller has waited long enough.
    pub fn set_patience(&mut self, patience: Patience<'a>) {
        self.patience = patience;
    }

    /// The same drawn back to the surfaces by a term with this factor, if there is one, and not projected.
    #[must_use]
    pub fn with_restoring(mut self, restoring: Option<f64>) -> Self {
        self.restoring = restoring;
        self
    }

    /// The same for states of these sizes.
    #[must_use]
    pub(crate) fn with_units(mut self, units: Units<'a>) -> Self {
        let parts = units.parts(self.system.n_states());
        if let Some(law) = &mut self.affine {
            law.set_units(&parts);
        }
        self.projector = self.projector.measured_in(parts);
        self.units = units;
        self
    }

    /// The same with the surfaces of the set scaled by `kappa`: for three and more of them it decides how long the
    /// root counts as stable.
    #[must_use]
    pub fn with_scaling(mut self, kappa: &[f64]) -> Self {
        if let Some(law) = &mut self.affine {
            law.set_scaling(kappa);
        }
        self.kappa.copy_from_slice(kappa);
        self
    }

    /// Takes over the discrete states that an action left.
    pub(super) fn set_discrete(&mut self, q: &[f64]) {
        self.setting.set_discrete(q);
        if let Some(law) = &mut self.affine {
            law.set_discrete(q);
        }
    }

    /// Starts anew on the same surfaces; `false` if these are others, or if all of it would have to be made anew.
    pub fn restart(&mut self, set: &[usize], setting: Setting<'_>) -> bool {
        if self.set != set || !self.is_lasting() {
            return false;
        }
        if let Some(law) = &mut self.affine {
            law.restart(setting);
        }
        self.setting.set(setting);
        self.canopy = None;
        self.lambda.clear();
        self.exits.fill(f64::NAN);
        self.slack.fill(0.0);
        self.is_rootless = false;
        self.n_evaluations = 0;
        self.begin(&[], false);
        true
    }

    /// Becomes the field of sliding on other surfaces, in the same space; `false`, and it is of no use, if it cannot.
    pub fn refit(&mut self, set: &[usize], setting: Setting<'_>, kappa: &[f64]) -> bool {
        let Some(law) = self.affine.as_mut().filter(|_| self.by_rule.is_none()) else {
            return false;
        };
        if !law.refit(set, setting) {
            return false;
        }
        law.set_scaling(kappa);
        self.kappa.clear();
        self.kappa.extend_from_slice(kappa);
        self.set.clear();
        self.set.extend_from_slice(set);
        self.has_canopy = set.len() <= MOST_MEETING;
        self.exits.resize(2 * set.len() + 2, f64::NAN);
        self.slack.resize(2 * set.len(), 0.0);
        self.restart(set, setting)
    }

    /// Is it worth to be kept for another motion?
    pub fn is_lasting(&self) -> bool {
        !IS_PAGE && self.affine.is_some() && self.by_rule.is_none()
    }

    /// Begins a motion: its multipliers are tracked from these, if there are any. `oscillates` says that the
    /// regularised motion goes around the root, so that it need not be stable.
    pub fn begin(&mut self, lambda: &[f64], oscillates: bool) {
        self.tracked.clear();
        self.reached = (f64::INFINITY, lambda.to_vec());
        self.start = None;
        self.watch = RootWatch::new(oscillates);
        if let Some(law) = &mut self.affine {
            law.begin();
        }
    }

    /// The equations vanish at the start of the motion: its multipliers there are those that it begins with. Beside a located
    /// start quotients are lost in rounding for a while.
    pub fn hold_at_start(&mut self, t: f64, is_located: bool) {
        let until = match is_located {
            true => t + HELD_AFTER * (1.0 + t.abs()),
            false => t,
        };
        self.start = Some(([t, until], self.reached.1.clone()));
    }

    /// Lets the multiplier of a guard go beyond its end by this much.
    pub fn set_slack(&mut self, guard: Guard, slack: f64) {
        let place = self.guards().iter().position(|own| *own == guard);
        if let Some(own) = place.and_then(|place| self.slack.get_mut(place)) {
            *own = slack;
        }
    }

    /// Do redundant contacts share their load at the last evaluation? The equations then do not determine the multipliers.
    pub fn shares_load(&self) -> bool {
        self.affine.as_ref().is_some_and(AffineLaw::is_shared)
    }

    /// N = grad h B at the last evaluation, where it is the same all along the motion.
    pub fn steady_normal(&self) -> Option<&SparseRows> {
        self.affine.as_ref()?.steady_normal()
    }

    /// Does the regularised motion oscillate around the root, for three and more surfaces?
    pub fn oscillates(&self) -> bool {
        self.watch.oscillates == Some(true)
    }

    /// The multipliers at the last evaluation, or if there are none those that were found nearest to time t.
    pub fn tracked(&self, t: f64) -> &[f64] {
        if self.lambda.is_empty() {
            by_distance(&self.reached, &self.tracked, t)[0]
        } else {
            &self.lambda
        }
    }

    /// The motion has come to time t: however far a step beyond it is tried, the next multipliers can be tracked from here.
    pub(super) fn come_to(&mut self, t: f64) {
        let mut found = std::mem::take(&mut self.tracked).into_iter();
        let nearest = |near: Dated, next: Dated| match (next.0 - t).abs() <= (near.0 - t).abs() {
            true => next,
            false => near,
        };
        if let Some(first) = found.next() {
            self.reached = found.fold(first, nearest);
        }
    }

    fn track(&mut self, t: f64) {
        if self.tracked.len() >= MOST_TRACKED {
            // Every other one is dropped: they stay spread over the times that were asked for.
            let mut index = 0;
            self.tracked.retain(|_| {
                index += 1;
                index % 2 == 0
            });
        }
        self.tracked.push((t, self.lambda.clone()));
    }

    /// The combination of the fields.
    pub fn rule(&self) -> SlidingRule {
        self.by_rule
            .as_ref()
            .map_or(SlidingRule::Canopy, RuleLaw::rule)
    }

    /// Why the chosen rule does not give the field at the last evaluation ([`RuleLaw::refusal`]). The canopy
    /// has its own decisions.
    pub fn refusal(&self, tolerance: f64) -> Option<RuleFailure> {
        let by_rule = self.by_rule.as_ref();
        let refused = self.refused.clone();
        refused.or_else(|| by_rule?.refusal(tolerance))
    }

    /// The motions that leave the intersection under the chosen rule ([`RuleLaw::leaving`]).
    pub fn leaving(&self, tolerance: f64) -> Vec<Mode> {
        let by_rule = self.by_rule.as_ref();
        by_rule.map_or_else(Vec::new, |law| law.leaving(tolerance))
    }

    /// The surfaces slid on.
    pub fn set(&self) -> &[usize] {
        &self.set
    }

    /// Were all fields there at the last evaluation, but no multipliers?
    pub fn is_rootless(&self) -> bool {
        self.is_rootless
    }

    /// Evaluates multipliers and exit functions at (t, x) and writes the field. Where there is no root they are NaN.
    fn solve(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), FieldError> {
        self.is_rootless = false;
        let is_held = |[from, until]: [f64; 2]| (from..=until).contains(&t);
        if self.start.as_ref().is_some_and(|(held, _)| is_held(*held)) {
            return self.solve_start(t, x, dx);
        }
        if let Some(law) = &mut self.by_rule {
            let place = self.setting.at(t, x);
            self.n_evaluations +=
                law.eval(self.system, (&place, self.units), &mut self.lambda, dx)?;
            self.exits.copy_from_slice(law.exits());
            return Ok(());
        }
        if let Some(law) = &mut self.affine {
            self.n_evaluations += law.eval(t, x, dx)?;
            if law.multipliers().iter().all(|l| l.is_finite()) {
                self.lambda.clear();
                self.lambda.extend(law.multipliers());
                let ends = law.ends(&mut self.watch);
                self.fill_exits(ends);
                return Ok(());
            }
        }
        if self.has_canopy && self.canopy.is_none() {
            self.canopy = Some(Canopy::new(self.system, &self.set, &self.kappa));
        }
        let found = match &mut self.canopy {
            Some(canopy) => {
                self.n_evaluations +=
                    canopy.evaluate(self.system, &self.setting.at(t, x), self.units)?;
                canopy.solve(
                    &by_distance(&self.reached, &self.tracked, t),
                    &mut self.watch,
                    dx,
                    self.patience,
                )
            }
            None => None,
        };
        match found {
            Some((lambda, ends)) => {
                self.lambda = lambda;
                self.track(t);
                self.fill_exits(ends);
            }
            None => {
                let canopy = self.canopy.as_ref();
                self.is_rootless = canopy.is_some_and(Canopy::is_finite);
                self.exits.fill(f64::NAN);
                self.lambda.clear();
                dx.fill(f64::NAN);
            }
        }
        Ok(())
    }

    /// Does what [`solve`](Self::solve) does, at a start with given multipliers and for as long as rounding spoils the quotients
    /// there. The two exit functions of the root are evaluated a moment later, so that they are continuous. If they are not both
    /// positive there, they are set to 1: the given root was chosen among the stable ones.
    fn solve_start(&mut self, t: f64, x: &[f64], dx: &mut [f64]) -> Result<(), FieldError> {
        let Some((held, lambda)) = self.start.take() else {
            return Ok(());
        };
        let mut around = MeetingFields::new(self.system, &self.set);
        self.n_evaluations += around.evaluate(self.system, &self.setting.at(t, x), self.units)?;
        let mut weights = Vec::new();
        around.fill_product_weights(&lambda, &mut weights);
        around.combine(&weights, dx);
        let moment = AT_SIDE * (1.0 + t.abs());
        let later: Vec<f64> = x.iter().zip(&*dx).map(|(x, v)| x + moment * v).collect();
        self.solve(t + moment, &later, &mut vec![0.0; x.len()])?;
        let ends = match self.exits[..] {
            [.., fold, stability] if fold > 0.0 && stability > 0.0 => [fold, stability],
            _ => [1.0, 1.0],
        };
        self.is_rootless = false;
        self.lambda.clone_from(&lambda);
        self.fill_exits(ends);
        self.start = Some((held, lambda));
        Ok(())
    }

    /// The ends of the multipliers, then those of the root.
    fn fill_exits(&mut self, [fold, stability]: [f64; 2]) {
        let pairs = self
            .exits
            .chunks_exact_mut(2)
            .zip(self.slack.chunks_exact(2));
        for ((pair, slack), lambda) in pairs.zip(&self.lambda) {
            (pair[0], pair[1]) = (1.0 + lambda + slack[0], 1.0 - lambda + slack[1]);
        }
        let m = self.lambda.len();
        // Contacts that share their load give way together.
        for place in 0..m {
            let reserve = self.affine.as_ref().and_then(|law| law.reserve(place));
            if let Some(reserve) = reserve {
                let slack = &self.slack[2 * place..];
                (self.exits[2 * place], self.exits[2 * place + 1]) =
                    (reserve + slack[0], reserve + slack[1]);
            }
        }
        (self.exits[2 * m], self.exits[2 * m + 1]) = (fold, stability);
    }
}

/// The multipliers, those with the nearest times first; of several the last.
fn by_distance<'f>(reached: &'f Dated, tracked: &'f [Dated], t: f64) -> Vec<&'f [f64]> {
    let mut all: Vec<&Dated> = tracked.iter().rev().chain([reached]).collect();
    let distance = |at: &&Dated| (at.0 - t).abs();
    sort_few(&mut all, |a, b| distance(a).total_cmp(&distance(b)).is_lt());
    all.into_iter().map(|found| &found.1[..]).collect()
}

impl Motion for IntersectionField<'_> {
    /// The ends of the multipliers, then those of the root.
    fn guards(&self) -> Guards {
        let ends = self.set.iter().flat_map(|&j| Guard::ends(j));
        ends.chain([RootEnd::Fold, RootEnd::Stability].map(Guard::Root))
            .collect()
    }

    fn last_exits(&self) -> &[f64] {
        &self.exits
    }

    fn multipliers(&self) -> SmallVec<[f64; 2]> {
        SmallVec::from_slice(&self.lambda)
    }

    fn project(&mut self, t: f64, x: &mut [f64]) -> Result<(), FieldError> {
        if self.restoring.is_some() {
            return Ok(());
        }
        match &mut self.affine {
            Some(law)
                if self.set.len() > MOST_MEETING || law.is_shared() || law.projects_at_once() =>
            {
                law.project(t, x, self.setting.get())
            }
            _ => {
                let setting = self.setting.get();
                self.projector
                    .project_onto(self.system, &self.set, t, x, setting)
            }
        }
    }
}

impl SmoothField for IntersectionField<'_> {
    fn eval(&mut self, t: f64, x: &mut [f64], dx: &mut [f64]) -> Result<(), FieldError> {
        self.project(t, x)?;
        self.solve(t, x, dx)?;
        if let Some(factor) = self.restoring {
            let term = (&self.set[..], factor);
            self.projector
                .pull_back(self.system, term, &self.setting.at(t, x), dx)?;
        }
        Ok(())
    }

    fn eval_unprojected(
        &mut self,
        t: f64,
        x: &mut [f64],
        dx: &mut [f64],
    ) -> Result<(), FieldError> {
        self.solve(t, x, dx)
    }

    fn n_evaluations(&self) -> u64 {
        self.n_evaluations
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use filippov_expr::{Backend, Graph, Names};

    use super::IntersectionField;
    use crate::motion::{Motion, SmoothField};
    use crate::system::{Setting, TracedSystem};

    /// x_i' = x_i - s_i (2 + s_2 x_i^2) - 0.3 s_(other), i = 0, 1, and x_2' = 1.
    fn system() -> TracedSystem {
        let mut g = Graph::new();
        let x = [0, 1, 2].map(|i| g.state(i));
        let s = x.map(|x| g.sign(x));
        let (two, share) = (g.constant(2.0), g.constant(0.3));
        let mut field = Vec::new();
        for i in 0..2 {
            let square = g.mul(x[i], x[i]);
            let bent = g.mul(s[2], square);
            let strength = g.add(two, bent);
            let (own, other) = (g.mul(s[i], strength), g.mul(share, s[1 - i]));
            let rate = g.sub(x[i], own);
            field.push(g.sub(rate, other));
        }
        field.push(g.constant(1.0));
        TracedSystem::new(g, field, Vec::new(), Names::default(), Backend::Auto).unwrap()
    }

    #[test]
    fn a_field_that_starts_anew_is_a_new_one() {
        let (system, set) = (system(), [0, 1]);
        let at = |field: &mut IntersectionField, x: [f64; 3]| {
            let (mut x, mut dx) = (x, [0.0; 3]);
            field.eval(0.2, &mut x, &mut dx).unwrap();
            (dx, field.multipliers(), field.last_exits().to_vec())
        };
        let (before, after) = ([1.0, 1.0, -1.0], [1.0, 1.0, 1.0]);
        let setting = Setting::of_signs(&after);
        let mut used = IntersectionField::new(&system, &set, Setting::of_signs(&before), &[]);
        at(&mut used, [0.1, -0.2, -1.0]);
        assert!(used.restart(&set, setting));
        let mut new = IntersectionField::new(&system, &set, setting, &[]);
        for x in [[0.0, 0.0, 0.4], [1e-3, -1e-3, 2.0]] {
            assert_eq!(at(&mut used, x), at(&mut new, x));
        }
        assert_eq!(used.n_evaluations(), new.n_evaluations());
        assert!(!used.restart(&[0, 2], setting));
    }

    #[test]
    fn signs_that_multiply_have_no_field_in_this_space() {
        let (system, signs) = (system(), [1.0; 3]);
        let setting = Setting::of_signs(&signs);
        let mut used = IntersectionField::new(&system, &[0, 1], setting, &[]);
        assert!(!used.refit(&[1, 2], setting, &[1.0; 2]));
    }

    #[test]
    fn the_space_serves_more_and_fewer_surfaces() {
        // v_i' = i - 2 - 4 sign(v_i) - sign(v_(i + 1)), each of four bodies pulled at by the next one.
        let mut g = Graph::new();
        let (four, v) = (g.constant(4.0), [0, 1, 2, 3].map(|i| g.state(i)));
        let s = v.map(|v| g.sign(v));
        let field = (0..4_usize).map(|i| {
            let (own, pull) = (g.mul(four, s[i]), g.constant(i as f64 - 2.0));
            let held = g.sub(pull, own);
            g.sub(held, s[(i + 1) % 4])
        });
        let field = field.collect();
        let system =
            TracedSystem::new(g, field, Vec::new(), Names::default(), Backend::Auto).unwrap();
        let signs = [1.0, -1.0, 1.0, -1.0];
        let setting = Setting::of_signs(&signs);
        let mut used = IntersectionField::new(&system, &[0, 2], setting, &[]);
        let sets: [&[usize]; 4] = [&[0, 1, 2, 3], &[1, 3], &[0, 1, 3], &[2, 3]];
        for set in sets {
            let kappa: Vec<f64> = (1..=set.len()).map(|k| k as f64).collect();
            assert!(used.refit(set, setting, &kappa));
            let mut new = IntersectionField::new(&system, set, setting, &[]).with_scaling(&kappa);
            let value = |field: &mut IntersectionField| {
                let (mut x, mut dx) = ([0.0; 4], [0.0; 4]);
                field.eval(0.2, &mut x, &mut dx).unwrap();
                (dx, field.multipliers(), field.last_exits().to_vec())
            };
            assert_eq!(value(&mut used), value(&mut new));
            assert_eq!(used.guards(), new.guards());
        }
    }
}
