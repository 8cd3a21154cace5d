//! Choices at points where the solution is not unique, from Rust.

use filippov::{
    ClosureSystem, Error, Mode, NonUnique, Options, Problem, Solution, Stop, WarningCode,
};

/// x' = sign(x) from x = 0.
fn from_rest(options: &Options) -> Result<Solution, Error> {
    let away = ClosureSystem::new(1, 1, |_t, _x, s, dx| dx[0] = s[0], |_t, x, h| h[0] = x[0]);
    Problem::new(&away, (0.0, 1.0), &[0.0])
        .options(options)
        .solve()
}

fn choosing(entries: &[i8]) -> Options {
    let choices = entries.iter().map(|&entry| Mode::new(vec![entry]));
    Options {
        choices: choices.collect(),
        ..Options::default()
    }
}

#[test]
fn candidates_are_in_the_warning_with_the_chosen_one_first() {
    let solution = from_rest(&Options::default()).unwrap();
    let [warning] = solution.warnings.as_slice() else {
        panic!("{:?}", solution.warnings)
    };
    assert_eq!(warning.code, WarningCode::NonUnique);
    assert_eq!(
        warning.candidates,
        [Mode::new(vec![1]), Mode::new(vec![-1])]
    );
}

#[test]
fn a_choice_is_followed_also_where_the_policy_is_to_stop() {
    for entry in [-1, 1] {
        let mut options = choosing(&[entry]);
        options.nonunique = NonUnique::Error;
        let solution = from_rest(&options).unwrap();
        assert!(solution.stop.is_success());
        assert!((solution.last_state()[0] - f64::from(entry)).abs() < 1e-12);
        assert_eq!(solution.warnings[0].candidates[0], Mode::new(vec![entry]));
    }
}

#[test]
fn a_choice_that_is_no_candidate_ends_the_run() {
    let solution = from_rest(&choosing(&[0])).unwrap();
    match solution.stop {
        Stop::NonUnique { candidates, .. } => assert_eq!(candidates.len(), 2),
        other => panic!("{other:?}"),
    }
}
