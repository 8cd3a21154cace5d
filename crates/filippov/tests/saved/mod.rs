//! Systems with everything that a saved system can have.
#![allow(clippy::unwrap_used)]

pub mod damage;
pub mod usage;

use filippov::action::{Clock, Trigger};
use filippov::{Definition, Law, Rules, SavedAction, SavedSystem, Step};
use filippov_expr::{BinaryOp, Graph, Names, NodeId, Switching, UnaryOp};

/// A saved system, and a state at which it starts.
pub struct Sample {
    pub name: &'static str,
    pub system: SavedSystem,
    pub start: Vec<f64>,
}

pub fn all_systems() -> Vec<Sample> {
    let sample = |name, system, start: &[f64]| Sample {
        name,
        system,
        start: start.to_vec(),
    };
    vec![
        sample("friction", friction(), &[1.0, 2.0]),
        sample("impacts", impacts(), &[1.0, 0.0]),
        sample("laws", laws(), &[0.2, 0.1]),
        sample("surfaces", surfaces(), &[0.4, -0.3, 0.2]),
    ]
}

fn names(states: &[&str], parameters: &[&str]) -> Names {
    let owned = |list: &[&str]| list.iter().map(|&name| name.to_owned()).collect();
    Names {
        states: owned(states),
        parameters: owned(parameters),
    }
}

/// y'' = -y + sin(w t) - F sign(v) with static friction above kinetic, good for these values only.
pub fn friction() -> SavedSystem {
    let mut g = Graph::new();
    let (t, y, v) = (g.time(), g.state(0), g.state(1));
    let (force, frequency, ratio) = (g.parameter(0), g.parameter(1), g.parameter(2));
    let phase = g.mul(frequency, t);
    let drive = g.unary(UnaryOp::Sin, phase);
    let sign = g.sign(v);
    let friction = g.mul(force, sign);
    let spring = g.sub(drive, y);
    let acceleration = g.sub(spring, friction);
    let definition = Definition {
        graph: g,
        field: vec![v, acceleration],
        names: names(&["y", "v"], &["F", "w", "ratio"]),
        rules: Rules {
            sticking: vec![(0, ratio)],
            ..Rules::default()
        },
    };
    let values = vec![0.4, 1.0 / 3.0, 1.2];
    SavedSystem {
        definition,
        valid_for: Some(values.clone()),
        defaults: values,
        actions: Vec::new(),
    }
}

/// A ball with impacts, with kicks at known times and at the ticks of a clock.
pub fn impacts() -> SavedSystem {
    let own_names = names(&["y", "v"], &["e", "g"]);
    let mut g = Graph::new();
    let (y, v, gravity) = (g.state(0), g.state(1), g.parameter(1));
    let floor = g.declare_surface(y) as usize;
    let definition = Definition {
        field: vec![v, g.neg(gravity)],
        graph: g,
        names: own_names.clone(),
        rules: Rules {
            watched: vec![floor],
            ..Rules::default()
        },
    };
    // v+ = -e v, and less than 3.
    let mut g = Graph::new();
    let (y, v, e) = (g.state(0), g.state(1), g.parameter(0));
    let speed = g.mul(e, v);
    let up = g.neg(speed);
    let most = g.constant(3.0);
    let bounded = g.minimum(up, most);
    let bounce = Definition {
        graph: g,
        field: vec![y, bounded],
        names: own_names.clone(),
        rules: Rules::default(),
    };
    let mut g = Graph::new();
    let (t, y, v) = (g.time(), g.state(0), g.state(1));
    let wave = g.unary(UnaryOp::Cos, t);
    let kick = Definition {
        field: vec![y, g.add(v, wave)],
        graph: g,
        names: own_names,
        rules: Rules::default(),
    };
    let action = |trigger, map: &Definition, name: &str| SavedAction {
        trigger,
        map: Some(map.clone()),
        name: name.into(),
    };
    let clock = Clock {
        period: 0.7,
        phase: 0.05,
    };
    SavedSystem {
        definition,
        defaults: vec![0.8, 9.81],
        valid_for: None,
        actions: vec![
            action(
                Trigger::Surface {
                    index: floor,
                    direction: -1,
                    side: 1,
                },
                &bounce,
                "bounce",
            ),
            action(Trigger::Times(vec![0.3, 1.1, 2.5]), &kick, "kick"),
            action(
                Trigger::Clock {
                    clock,
                    at_start: false,
                },
                &kick,
                "tick",
            ),
        ],
    }
}

/// A number that nobody sets, a clock, a floor of it, the nearest number to a state, and a relay with hysteresis.
pub fn laws() -> SavedSystem {
    const FIRST: u32 = 3;
    let mut g = Graph::new();
    let (t, x, y) = (g.time(), g.state(0), g.state(1));
    let (gain, level) = (g.parameter(0), g.parameter(1));
    let q: Vec<NodeId> = (0..4).map(|k| g.parameter(FIRST + k)).collect();
    let half = g.constant(0.5);
    let three = g.constant(3.0);
    let ticks = g.mul(three, t);
    let halved = g.mul(half, q[0]);
    let fine = g.mul(three, y);

    let named = g.parameter(2);
    let pull = g.mul(named, q[3]);
    let drive = g.sub(q[1], halved);
    let dx = g.sub(drive, pull);

    // The floor of 3 y, which is the same before and after a change of q.
    let distance = g.sub(fine, q[2]);
    let side = g.sign(distance);
    let step = g.mul(half, side);
    let below = g.sub(q[2], half);
    let floor = g.add(below, step);
    let push = g.sub(x, floor);
    let field = vec![dx, push];

    let Switching::Surface { index, orientation } = g.switch(distance) else {
        panic!("a switch")
    };
    let size = g.abs(distance);
    let inside = g.sub(half, size);
    let near = g.declare_surface(inside) as usize;
    let low = g.neg(level);
    let switched = g.mul(q[3], x);
    let band = g.add(switched, level);
    let relay = g.declare_surface(band) as usize;
    let n_hidden = g.n_surfaces();
    let laws = vec![
        Law::Named { initial: gain },
        Law::Clock { argument: ticks },
        Law::Held {
            argument: halved,
            step: Step::Floor,
        },
        Law::Level {
            argument: fine,
            surface: index as usize,
            orientation,
            guard: near,
        },
        Law::Hysteresis {
            argument: x,
            thresholds: [low, level],
            initial: -1.0,
            guard: relay,
        },
    ];
    let law_names = [
        "gear",
        "floor(3*t)",
        "floor(q/2)",
        "nearest(3*y)",
        "hysteresis(x)",
    ];
    let parameters = [&["gain", "level"], &law_names[..]].concat();
    SavedSystem {
        definition: Definition {
            graph: g,
            field,
            names: names(&["x", "y"], &parameters),
            rules: Rules {
                laws,
                n_hidden,
                ..Rules::default()
            },
        },
        defaults: vec![1.0, 0.5],
        valid_for: None,
        actions: Vec::new(),
    }
}

/// Three surfaces: a nested one, a product of signs, a bounded and a selected value; no names of states.
pub fn surfaces() -> SavedSystem {
    let mut g = Graph::new();
    let (t, x, y, z) = (g.time(), g.state(0), g.state(1), g.state(2));
    let size = g.abs(x);
    let ring = g.sub(size, y);
    let s = g.sign(ring);
    let r = g.sign(x);
    let both = g.mul(s, r);
    let sine = g.unary(UnaryOp::Sin, t);
    let minus_z = g.neg(z);
    let base = g.unary(UnaryOp::Exp, minus_z);
    let curved = g.binary(BinaryOp::Pow, base, t);
    let top = g.maximum(z, sine);
    let hypot = g.binary(BinaryOp::Hypot, x, y);
    let root = g.unary(UnaryOp::Sqrt, hypot);
    let dx = g.sub(both, root);
    let weight = g.parameter(0);
    let dy = g.mul(weight, s);
    let down = g.sub(curved, top);
    let turned = g.neg(top);
    let dz = g.select(0, 1.0, down, turned);
    SavedSystem {
        definition: Definition {
            graph: g,
            field: vec![dx, dy, dz],
            names: names(&[], &["weight"]),
            rules: Rules::default(),
        },
        defaults: vec![-0.7],
        valid_for: None,
        actions: Vec::new(),
    }
}
