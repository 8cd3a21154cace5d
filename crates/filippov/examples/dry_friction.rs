//! The dry-friction oscillator from closures, without Python: the example of the README.
//!
//! `cargo run --release -p filippov --example dry_friction`

#![allow(clippy::print_stdout)]

use filippov::{ClosureSystem, Options, Problem};

fn main() -> Result<(), filippov::Error> {
    // y'' = -y + sin(t/3) - 0.4 sign(y'); s[0] is the sign of the switching function h[0] = y'.
    let oscillator = ClosureSystem::new(
        2,
        1,
        |t, x, s, dx| {
            dx[0] = x[1];
            dx[1] = -x[0] + (t / 3.0).sin() - 0.4 * s[0];
        },
        |_t, x, h| h[0] = x[1],
    );
    let options = Options::default();
    let solution = Problem::new(&oscillator, (0.0, 60.0), &[1.0, 2.0])
        .options(&options)
        .solve()?;
    for switch in solution.switches.iter() {
        let (kind, mode) = (switch.kind.name(), &switch.mode_after);
        println!("{:.6}  {kind}  ({mode})", switch.t);
    }
    Ok(())
}
