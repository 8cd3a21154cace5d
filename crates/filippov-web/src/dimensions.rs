//! A window on two states, the others held fixed.

use crate::model::Model;
use crate::refusal::Refusal;
use crate::request::Request;

/// Most cells along each side of a window.
const MOST_CELLS: u64 = 1000;

/// Two states over a rectangle, and values of the others.
#[derive(Clone)]
pub struct Window {
    /// Which states.
    pub axes: [usize; 2],
    /// Low and high end of each.
    pub low: [f64; 2],
    pub high: [f64; 2],
    /// The values of all states; those of the axes are replaced.
    pub rest: Vec<f64>,
    /// How many cells along each side.
    pub cells: usize,
}

impl Window {
    /// Reads `axes`, `box`, `rest` and `cells`.
    pub fn read(model: &Model, request: &Request, cells: usize) -> Result<Self, Refusal> {
        let (page, n) = (Request::page(model), model.n());
        let axes = match request.exactly::<2>("axes")? {
            Some(axes) => Some(axes),
            None => page.exactly::<2>("axes")?,
        };
        let axes = axes.unwrap_or([0.0, 1.0]);
        let is_state = |axis: &f64| axis.fract() == 0.0 && (0.0..n as f64).contains(axis);
        if !axes.iter().all(is_state) || axes[0] == axes[1] {
            let requirement = format!("two different states from 0 to {} are needed", n - 1);
            return Err(request.wrong("axes", &requirement));
        }
        let found = request.exactly::<4>("box")?;
        let [x0, x1, y0, y1] = request.needed("box", found)?;
        if !(x0 < x1 && y0 < y1) {
            return Err(request.wrong(
                "box",
                "[x0, x1, y0, y1] with x0 < x1 and y0 < y1 are needed",
            ));
        }
        let rest = match request.numbers("rest")? {
            Some(rest) => Some(rest),
            None => page.numbers("y0")?,
        };
        let rest = rest.unwrap_or_else(|| vec![0.0; n]);
        if rest.len() != n {
            return Err(request.wrong("rest", &format!("{n} numbers are needed, one per state")));
        }
        let cells = request
            .count("cells", MOST_CELLS)?
            .map_or(cells, |cells| cells as usize);
        if cells == 0 {
            return Err(request.wrong("cells", "must be positive"));
        }
        Ok(Window {
            axes: axes.map(|axis| axis as usize),
            low: [x0, y0],
            high: [x1, y1],
            rest,
            cells,
        })
    }

    /// The state at a point of the window.
    pub fn state(&self, point: [f64; 2]) -> Vec<f64> {
        let mut x = self.rest.clone();
        for (axis, value) in self.axes.into_iter().zip(point) {
            x[axis] = value;
        }
        x
    }

    /// The point of a state.
    pub fn point(&self, x: &[f64]) -> [f64; 2] {
        self.axes.map(|axis| x[axis])
    }

    /// The point at these shares of both sides.
    pub fn at(&self, share: [f64; 2]) -> [f64; 2] {
        std::array::from_fn(|k| self.low[k] + share[k] * (self.high[k] - self.low[k]))
    }

    /// Is a point in it?
    pub fn contains(&self, point: [f64; 2]) -> bool {
        (0..2).all(|k| (self.low[k]..=self.high[k]).contains(&point[k]))
    }

    /// The centre of a cell.
    pub fn centre(&self, column: usize, row: usize, cells: usize) -> [f64; 2] {
        let share = |index: usize| (index as f64 + 0.5) / cells as f64;
        self.at([share(column), share(row)])
    }

    /// The distance of two points in shares of the sides.
    pub fn distance(&self, a: [f64; 2], b: [f64; 2]) -> f64 {
        let share = |k: usize| ((a[k] - b[k]) / (self.high[k] - self.low[k])).abs();
        share(0).max(share(1))
    }
}
