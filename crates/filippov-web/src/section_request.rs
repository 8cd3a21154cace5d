//! Sections in requests.

use filippov::action::Clock;
use filippov::section::{Place, Section};
use filippov::Kind;
use serde_json::Value;

use crate::model::Model;
use crate::refusal::Refusal;
use crate::request::Request;

const MOST_RETURNS: u64 = 1_000_000;
/// Returns that are kept, unless the request asks for others.
const RETURNS: u64 = 100;

/// Where a run is looked at, how many first returns are left out, and how many are kept.
pub struct SectionRequest {
    place: Where,
    skip: u64,
    count: u64,
}

type Function = Box<dyn Fn(f64, &[f64]) -> f64 + Sync>;

enum Where {
    Surface {
        index: usize,
        direction: i8,
        kind: Option<Kind>,
    },
    State {
        function: Function,
        direction: f64,
    },
    /// One period for all runs, or one for each.
    Ticks {
        periods: Vec<f64>,
        phase: f64,
    },
}

impl SectionRequest {
    pub fn read(model: &Model, request: &Request) -> Result<Self, Refusal> {
        let section = request.object("section")?;
        let section = request.needed("section", section)?;
        let direction = section.number("direction")?.unwrap_or(0.0);
        if ![-1.0, 0.0, 1.0].contains(&direction) {
            return Err(section.wrong("direction", "must be -1, 0 or 1"));
        }
        let place = if section.get("surface").is_some() {
            let index = section.choice("surface", &model.description.surfaces)?;
            Where::Surface {
                index: section.needed("surface", index)?,
                direction: direction as i8,
                kind: section
                    .text("kind")?
                    .map(|name| kind_of(&section, name))
                    .transpose()?,
            }
        } else if section.get("state").is_some() {
            let index = section.choice("state", &model.description.states)?;
            let index = section.needed("state", index)?;
            let value = section.number("value")?.unwrap_or(0.0);
            Where::State {
                function: Box::new(move |_, x| x[index] - value),
                direction,
            }
        } else {
            let periods = match section.get("period") {
                Some(Value::Array(_)) => section.numbers("period")?,
                _ => section.number("period")?.map(|period| vec![period]),
            };
            let requirement = "give a surface, a state with a value, or a period";
            let periods = periods.filter(|periods| !periods.is_empty());
            let periods = periods.ok_or_else(|| request.wrong("section", requirement))?;
            if !periods.iter().all(|&period| period > 0.0) {
                return Err(section.wrong("period", "must be positive"));
            }
            Where::Ticks {
                periods,
                phase: section.number("phase")?.unwrap_or(0.0),
            }
        };
        Ok(SectionRequest {
            place,
            skip: request.count("skip", MOST_RETURNS)?.unwrap_or(0),
            count: request.count("count", MOST_RETURNS)?.unwrap_or(RETURNS),
        })
    }

    /// How many periods are given, if the section is a clock.
    pub fn n_periods(&self) -> Option<usize> {
        match &self.place {
            Where::Ticks { periods, .. } => Some(periods.len()),
            _ => None,
        }
    }

    /// How long the run number `index` takes at a clock.
    pub fn duration(&self, index: usize) -> Option<f64> {
        let ticks = (self.skip + self.count + 1) as f64;
        self.period(index).map(|period| period * ticks)
    }

    /// The first tick of the clock of run number `index`, from a time on.
    pub fn first_tick(&self, index: usize, t: f64) -> Option<f64> {
        match (&self.place, self.period(index)) {
            (Where::Ticks { phase, .. }, Some(period)) => {
                Some(phase + ((t - phase) / period).ceil() * period)
            }
            _ => None,
        }
    }

    fn period(&self, index: usize) -> Option<f64> {
        match &self.place {
            Where::Ticks { periods, .. } => periods.get(index).or(periods.first()).copied(),
            _ => None,
        }
    }

    /// The section of run number `index`.
    pub fn section(&self, index: usize) -> Section<'_> {
        let place = match &self.place {
            &Where::Surface {
                index,
                direction,
                kind,
            } => Place::Surface {
                index,
                direction,
                kind,
            },
            Where::State {
                function,
                direction,
            } => Place::Function {
                function,
                direction: *direction,
            },
            Where::Ticks { phase, .. } => Place::Ticks(Clock {
                period: self.period(index).unwrap_or(f64::NAN),
                phase: *phase,
            }),
        };
        Section {
            place,
            transient: self.skip,
            most: self.count,
            cycle: None,
            keeps_pieces: false,
        }
    }
}

fn kind_of(section: &Request, name: &str) -> Result<Kind, Refusal> {
    let names = Kind::ALL.map(Kind::name).join(", ");
    Kind::named(name).ok_or_else(|| section.wrong("kind", &format!("{name:?} is none of {names}")))
}
