//! Saved systems come back as they were, and no bytes make anything panic: they are refused, or give a system that
//! can be used.
//!
//! `SAVED_SYSTEMS` is how many damaged byte strings the long test tries, `SAVED_SEED` where it begins.
#![allow(clippy::unwrap_used)]

mod saved;

use std::panic::{catch_unwind, AssertUnwindSafe};

use filippov::action::{Clock, Trigger};
use filippov::{Error, Method, Options, SavedSystem};
use filippov_expr::{Backend, ExprError};
use saved::damage::Damage;
use saved::usage::use_everything;
use saved::{all_systems, Sample};

#[test]
fn systems_come_back_as_they_were() {
    for sample in all_systems() {
        let bytes = sample.system.to_bytes();
        let copy = SavedSystem::from_bytes(&bytes).unwrap();
        assert_eq!(copy.to_bytes(), bytes, "{}", sample.name);
        assert_eq!(copy.defaults, sample.system.defaults);
        assert_eq!(copy.valid_for, sample.system.valid_for);
        assert_eq!(copy.definition.rules, sample.system.definition.rules);
        let solve = |system: SavedSystem| {
            let parameters = system.defaults.clone();
            let runnable = system.build(Backend::Auto).unwrap();
            let options = Options {
                method: Method::Auto,
                ..Options::default()
            };
            runnable
                .solve((0.0, 3.0), &sample.start, &parameters, &options, &[])
                .unwrap()
        };
        let (before, after) = (solve(sample.system.clone()), solve(copy));
        assert!(after.stop.is_success(), "{}: {:?}", sample.name, after.stop);
        assert!(!after.switches.is_empty(), "{}", sample.name);
        assert_eq!(before.last_state(), after.last_state(), "{}", sample.name);
        assert_eq!(before.switches.len(), after.switches.len());
    }
}

#[test]
fn a_map_that_is_a_function_of_the_caller_is_missed_by_name() {
    let mut impact = saved::impacts();
    impact.actions[0].map = None;
    let copy = SavedSystem::from_bytes(&impact.to_bytes()).unwrap();
    match copy.build(Backend::Interpreter).err() {
        Some(Error::MissingMap { name }) => assert_eq!(name, "bounce"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn wrong_values_and_triggers_are_named() {
    type Change = fn(&mut SavedSystem);
    let refused = |change: Change| {
        let mut system = saved::impacts();
        change(&mut system);
        let written = SavedSystem::from_bytes(&system.to_bytes())
            .unwrap_err()
            .to_string();
        assert_eq!(system.check().unwrap_err().to_string(), written);
        written
    };
    let clock = |period, phase| Trigger::Clock {
        clock: Clock { period, phase },
        at_start: true,
    };
    let cases: [(Change, &str); 6] = [
        (|s| s.defaults[0] = f64::NAN, "params = NaN: must be finite"),
        (
            |s| s.valid_for = Some(Vec::new()),
            "the system is inconsistent: the number of values is not that of the parameters",
        ),
        (
            |s| s.definition.names.parameters[1] = "e".into(),
            "the system is inconsistent: two states or two parameters of one name",
        ),
        (
            |s| s.actions[1].trigger = Trigger::Times(vec![1.0, 1.0]),
            "times = 1: must be above the time before",
        ),
        (
            |s| {
                s.actions[0].trigger = Trigger::Surface {
                    index: 0,
                    direction: 2,
                    side: 1,
                }
            },
            "direction = 2: must be -1, 0 or +1",
        ),
        (
            |s| s.definition.rules.watched.clear(),
            "the system is inconsistent: an action at a surface that is not watched",
        ),
    ];
    for (change, expected) in cases {
        assert_eq!(refused(change), expected);
    }
    for (trigger, expected) in [
        (clock(0.0, 0.0), "period = 0: must be positive"),
        (clock(f64::INFINITY, 0.0), "period = inf: must be positive"),
        (clock(1.0, f64::NAN), "phase = NaN: must be finite"),
    ] {
        let mut system = saved::impacts();
        system.actions[1].trigger = trigger;
        assert_eq!(system.check().unwrap_err().to_string(), expected);
    }
}

#[test]
fn other_contents_are_refused_by_name() {
    let definition = saved::impacts().definition;
    let refused = |bytes: &[u8]| match SavedSystem::from_bytes(bytes) {
        Err(Error::Expression(error)) => error,
        other => panic!("{other:?}"),
    };
    assert!(matches!(
        refused(&definition.to_bytes()),
        ExprError::OtherContent { .. }
    ));
    assert_eq!(refused(b"PK\x03\x04 an archive"), ExprError::UnknownFormat);
}

/// What became of damaged byte strings.
#[derive(Debug, Default)]
struct Tally {
    refused: usize,
    refused_when_built: usize,
    used: usize,
    /// Case and message.
    panicked: Vec<(u64, String)>,
}

fn try_damaged(cases: std::ops::Range<u64>) -> Tally {
    let samples: Vec<(Vec<u8>, Sample)> = all_systems()
        .into_iter()
        .map(|sample| (sample.system.to_bytes(), sample))
        .collect();
    let sources: Vec<Vec<u8>> = samples.iter().map(|(bytes, _)| bytes.clone()).collect();
    let mut tally = Tally::default();
    for case in cases {
        let (bytes, is_sealed) = Damage::new(case).of_one(&sources);
        let outcome = catch_unwind(AssertUnwindSafe(|| {
            let Ok(system) = SavedSystem::from_bytes(&bytes) else {
                return 0;
            };
            assert!(
                is_sealed || sources.contains(&bytes),
                "the checksum found nothing"
            );
            let again = SavedSystem::from_bytes(&system.to_bytes());
            assert!(again.is_ok(), "is not read again: {:?}", again.err());
            if use_everything(system, case) {
                2
            } else {
                1
            }
        }));
        match outcome {
            Ok(0) => tally.refused += 1,
            Ok(1) => tally.refused_when_built += 1,
            Ok(_) => tally.used += 1,
            Err(message) => {
                let text = message
                    .downcast_ref::<String>()
                    .cloned()
                    .or_else(|| message.downcast_ref::<&str>().map(|&s| s.to_owned()));
                tally.panicked.push((case, text.unwrap_or_default()));
            }
        }
    }
    tally
}

#[test]
fn damaged_bytes_are_refused_or_give_a_system_that_can_be_used() {
    let tally = try_damaged(0..4000);
    assert!(tally.panicked.is_empty(), "{tally:?}");
    assert!(tally.refused > 2000 && tally.used > 400, "{tally:?}");
}

#[test]
#[ignore = "minutes; make fuzz runs it"]
fn many_damaged_bytes() {
    let number =
        |name: &str, usual: u64| std::env::var(name).map_or(usual, |text| text.parse().unwrap());
    let first = number("SAVED_SEED", 0);
    let tally = try_damaged(first..first + number("SAVED_SYSTEMS", 100_000));
    eprintln!(
        "refused {}, refused when built {}, used {}",
        tally.refused, tally.refused_when_built, tally.used
    );
    assert!(tally.panicked.is_empty(), "{tally:?}");
}
