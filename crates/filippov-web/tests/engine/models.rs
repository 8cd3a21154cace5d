//! Models for the tests, and replies as they are read.

use filippov::action::Trigger;
use filippov::{Definition, Rules, SavedAction, SavedSystem};
use filippov_expr::{Graph, Names, NodeId, UnaryOp};
use filippov_web::{answer, pack, Model};
use serde_json::Value;

/// A reply: header and numbers.
pub struct Reply {
    pub header: Value,
    numbers: Vec<f64>,
}

impl Reply {
    pub fn new(bytes: &[u8]) -> Self {
        let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
        let header = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
        let begin = (4 + length).next_multiple_of(8);
        let numbers = bytes[begin..].chunks_exact(8);
        let numbers = numbers.map(|chunk| f64::from_le_bytes(chunk.try_into().unwrap()));
        Reply {
            header,
            numbers: numbers.collect(),
        }
    }

    pub fn array(&self, name: &str) -> &[f64] {
        let entry = &self.header["arrays"][name];
        let offset = entry[0].as_u64().unwrap() as usize;
        let shape = entry[1].as_array().unwrap().iter();
        let size: u64 = shape.map(|n| n.as_u64().unwrap()).product();
        &self.numbers[offset..][..size as usize]
    }
}

/// The reply to a request, which must be a good one.
pub fn ask(model: &Model, request: &str) -> Reply {
    let reply = Reply::new(&answer(model, request.as_bytes()));
    assert_eq!(reply.header["ok"], true, "{request}: {}", reply.header);
    reply
}

fn names(states: &[&str], parameters: &[&str]) -> Names {
    let owned = |list: &[&str]| list.iter().map(|&name| name.to_owned()).collect();
    Names {
        states: owned(states),
        parameters: owned(parameters),
    }
}

fn saved(graph: Graph, field: Vec<NodeId>, names: Names, defaults: &[f64]) -> SavedSystem {
    let definition = Definition {
        graph,
        field,
        names,
        rules: Rules::default(),
    };
    SavedSystem {
        definition,
        defaults: defaults.to_vec(),
        ..SavedSystem::default()
    }
}

/// y'' = -y + sin(t/3) - F sign y', the oscillator of Piiroinen and Kuznetsov (2008), with a page.
pub fn oscillator() -> Model {
    let mut g = Graph::new();
    let (t, y, v, friction) = (g.time(), g.state(0), g.state(1), g.parameter(0));
    let third = g.constant(3.0);
    let phase = g.div(t, third);
    let drive = g.unary(UnaryOp::Sin, phase);
    let sign = g.sign(v);
    let force = g.mul(friction, sign);
    let rest = g.sub(drive, y);
    let field = vec![v, g.sub(rest, force)];
    let system = saved(g, field, names(&["y", "v"], &["F"]), &[0.4]);
    let page =
        r#"{"title": "friction", "y0": [1, 2], "t_span": [0, 60], "rtol": 1e-9, "atol": 1e-9}"#;
    Model::from_bytes(&pack(&system.to_bytes(), page).unwrap()).unwrap()
}

/// x' = v, v' = -x - |x| / 10, which crosses x = 0 twice in each turn.
pub fn stiffening() -> Model {
    let mut g = Graph::new();
    let (x, v, tenth) = (g.state(0), g.state(1), g.constant(-0.1));
    let size = g.abs(x);
    let extra = g.mul(tenth, size);
    let field = vec![v, g.sub(extra, x)];
    Model::from_bytes(&saved(g, field, names(&["x", "v"], &[]), &[]).to_bytes()).unwrap()
}

/// y' = v, v' = -y - F sign v: dry friction without a force.
pub fn friction() -> Model {
    let mut g = Graph::new();
    let (y, v, friction) = (g.state(0), g.state(1), g.parameter(0));
    let sign = g.sign(v);
    let force = g.mul(friction, sign);
    let sum = g.add(y, force);
    let field = vec![v, g.neg(sum)];
    Model::from_bytes(&saved(g, field, names(&["y", "v"], &["F"]), &[0.5]).to_bytes()).unwrap()
}

/// x' = a - sign y, y' = b - x - y - 2 sign y: on y = 0 it slides, with a pseudo-equilibrium at lambda = a, x = b - 2 a.
pub fn sliding() -> Model {
    let mut g = Graph::new();
    let (x, y, a, b) = (g.state(0), g.state(1), g.parameter(0), g.parameter(1));
    let sign = g.sign(y);
    let along = g.sub(a, sign);
    let difference = g.sub(b, x);
    let difference = g.sub(difference, y);
    let twice = g.add(sign, sign);
    let field = vec![along, g.sub(difference, twice)];
    let names = names(&["x", "y"], &["a", "b"]);
    Model::from_bytes(&saved(g, field, names, &[0.25, 1.0]).to_bytes()).unwrap()
}

/// x' = s - x, y' = -y with s = sign x: everything comes to (-1, 0) or (1, 0).
pub fn two_nodes() -> Model {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let sign = g.sign(x);
    let field = vec![g.sub(sign, x), g.neg(y)];
    Model::from_bytes(&saved(g, field, names(&["x", "y"], &[]), &[]).to_bytes()).unwrap()
}

/// A saddle and two centres, held back by a force in proportion to the square of the speed: the field has a kink at y = 0.
pub fn quadratic_drag() -> Model {
    let mut g = Graph::new();
    let (x, y) = (g.state(0), g.state(1));
    let (squared, size) = (g.mul(x, x), g.abs(y));
    let (cubed, drag) = (g.mul(squared, x), g.mul(y, size));
    let force = g.sub(x, cubed);
    let field = vec![y, g.sub(force, drag)];
    Model::from_bytes(&saved(g, field, names(&["x", "y"], &[]), &[]).to_bytes()).unwrap()
}

/// A ball that falls on a table and loses a part of its speed.
pub fn ball() -> Model {
    let mut g = Graph::new();
    let (y, v, gravity) = (g.state(0), g.state(1), g.constant(-9.81));
    let surface = g.declare_surface(y) as usize;
    let own = names(&["y", "v"], &["e"]);
    let mut system = saved(g, vec![v, gravity], own.clone(), &[0.5]);
    system.definition.rules.watched = vec![surface];
    let mut g = Graph::new();
    let (y, v, e) = (g.state(0), g.state(1), g.parameter(0));
    let speed = g.mul(e, v);
    let field = vec![y, g.neg(speed)];
    system.actions = vec![SavedAction {
        trigger: Trigger::Surface {
            index: surface,
            direction: -1,
            side: 1,
        },
        map: Some(saved(g, field, own, &[0.5]).definition),
        name: "impact".into(),
    }];
    Model::from_bytes(&system.to_bytes()).unwrap()
}
