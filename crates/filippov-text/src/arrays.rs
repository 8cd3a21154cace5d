//! Arrays of NumPy with one or two axes: made, indexed, combined element by element, multiplied.

use std::rc::Rc;

use ruff_python_ast::{Expr, ExprSlice, Operator};
use ruff_text_size::Ranged;

use crate::reader::Reader;
use crate::tables::lookup;
use crate::unreadable::{refuse, Refused};
use crate::values::{Array, List, Value};

/// What is done to the elements of two arrays in the same place.
pub type OfTwo<'f, 'a> = dyn FnMut(&mut Reader<'a>, &Value, &Value) -> Result<Value, Refused> + 'f;

/// What is done to an element.
pub type OfOne<'f, 'a> = dyn FnMut(&mut Reader<'a>, &Value) -> Result<Value, Refused> + 'f;

/// Which entries of an axis are taken.
enum Taken {
    One(usize),
    Some(Vec<usize>),
}

/// The array of a list of numbers, or of lists of such, as `np.array` makes it.
pub fn array_of(part: &impl Ranged, value: &Value) -> Result<Rc<Array>, Refused> {
    let rows = match value {
        Value::Array(array) => {
            return Ok(Array::new(
                array.shape.clone(),
                array.items.borrow().clone(),
                false,
            ))
        }
        Value::List(list) => list.items.borrow().clone(),
        _ => return refuse(part, "an array is made of a list"),
    };
    let is_row = |row: &Value| matches!(row, Value::List(_) | Value::Array(_));
    let (shape, mut items) = if rows.iter().all(Value::is_scalar) {
        (vec![rows.len()], rows)
    } else if rows.iter().all(is_row) {
        let inner: Vec<Rc<Array>> = rows
            .iter()
            .map(|row| array_of(part, row))
            .collect::<Result<_, _>>()?;
        let width = inner[0].shape[0];
        let is_even = |row: &Rc<Array>| row.shape.len() == 1 && row.shape[0] == width;
        if !inner.iter().all(is_even) {
            return refuse(
                part,
                "the rows of an array have one length, and arrays two axes at most",
            );
        }
        let items = inner.iter().flat_map(|row| row.items.borrow().clone());
        (vec![inner.len(), width], items.collect())
    } else {
        return refuse(
            part,
            "an array is read with numbers, or with rows of numbers, in one list",
        );
    };
    // Of numbers NumPy makes one type.
    let is_number = |item: &Value| item.number().is_some();
    let is_whole = |item: &Value| matches!(item, Value::Number { is_whole: true, .. });
    if items.iter().all(is_number) && !items.iter().all(is_whole) {
        for item in &mut items {
            if let Value::Number { is_whole, .. } = item {
                *is_whole = false;
            }
        }
    }
    Ok(Array::new(shape, items, false))
}

/// An array of floats.
pub fn floats(values: Vec<f64>) -> Value {
    let shape = vec![values.len()];
    let items = values.into_iter().map(Value::float).collect();
    Value::Array(Array::new(shape, items, false))
}

impl<'a> Reader<'a> {
    /// Applies a function to two values, element by element where one of them is an array.
    pub fn by_elements(
        &mut self,
        part: &impl Ranged,
        a: &Value,
        b: &Value,
        function: &mut OfTwo<'_, 'a>,
    ) -> Result<Value, Refused> {
        let is_plain = |value: &Value| !matches!(value, Value::Array(_) | Value::List(_));
        if is_plain(a) && is_plain(b) {
            return function(self, a, b);
        }
        let is_traced = a.is_traced() || b.is_traced();
        let [(shape_a, items_a), (shape_b, items_b)] = [a, b]
            .map(|value| match value {
                Value::Array(array) => Ok((array.shape.clone(), array.items.borrow().clone())),
                Value::List(_) => {
                    let array = array_of(part, value)?;
                    let items = array.items.borrow().clone();
                    Ok((array.shape.clone(), items))
                }
                scalar => Ok((Vec::new(), vec![scalar.clone()])),
            })
            .into_iter()
            .collect::<Result<Vec<_>, Refused>>()?
            .try_into()
            .unwrap_or_else(|_| [(Vec::new(), Vec::new()), (Vec::new(), Vec::new())]);
        let rank = shape_a.len().max(shape_b.len());
        let padded = |shape: &[usize]| [vec![1; rank - shape.len()], shape.to_vec()].concat();
        let (wide_a, wide_b) = (padded(&shape_a), padded(&shape_b));
        let mut shape = Vec::new();
        for (&a, &b) in wide_a.iter().zip(&wide_b) {
            if a != b && a != 1 && b != 1 {
                let error = format!("arrays of the shapes {shape_a:?} and {shape_b:?}");
                return refuse(part, error);
            }
            shape.push(if a == 1 { b } else { a });
        }
        let n: usize = shape.iter().product();
        let columns = shape.last().copied().unwrap_or(1).max(1);
        let place = |wide: &[usize], k: usize| {
            let (row, column) = (k / columns, k % columns);
            let width = wide.last().copied().unwrap_or(1);
            let column = if width == 1 { 0 } else { column };
            match wide {
                [rows, _] if *rows != 1 => row * width + column,
                _ => column,
            }
        };
        let mut items = Vec::with_capacity(n);
        for k in 0..n {
            let (a, b) = (&items_a[place(&wide_a, k)], &items_b[place(&wide_b, k)]);
            items.push(function(self, a, b)?);
        }
        Ok(Value::Array(Array::new(shape, items, is_traced)))
    }

    /// Applies a function to a value, or to the elements of an array.
    pub fn by_element(
        &mut self,
        a: &Value,
        function: &mut OfOne<'_, 'a>,
    ) -> Result<Value, Refused> {
        let Value::Array(array) = a else {
            return function(self, a);
        };
        let items = array.items.borrow().clone();
        let mut found = Vec::with_capacity(items.len());
        for item in &items {
            found.push(function(self, item)?);
        }
        let array = Array::new(array.shape.clone(), found, array.is_traced);
        Ok(Value::Array(array))
    }

    /// `a @ b`; the zeros of a matrix of numbers give no terms.
    pub fn matrix_product(
        &mut self,
        part: &impl Ranged,
        a: &Value,
        b: &Value,
    ) -> Result<Value, Refused> {
        let is_array = |value: &Value| matches!(value, Value::Array(_));
        if !is_array(a) && !is_array(b) {
            return refuse(
                part,
                "a product of matrices is read of arrays: write np.array([...])",
            );
        }
        let (a, b) = (as_array(part, a)?, as_array(part, b)?);
        let is_traced = a.is_traced || b.is_traced;
        if !(is_traced || a.is_of_numbers() && b.is_of_numbers()) {
            return refuse(part, "a product of an array that is made of traced values is not read here: write it out");
        }
        let inner = a.shape[a.shape.len() - 1];
        if inner != b.shape[0] {
            let error = format!("a product of the shapes {:?} and {:?}", a.shape, b.shape);
            return refuse(part, error);
        }
        let (rows, columns) = (
            if a.shape.len() == 2 { a.shape[0] } else { 1 },
            if b.shape.len() == 2 { b.shape[1] } else { 1 },
        );
        let skips_zeros_of_a = a.shape.len() == 2 && a.is_of_numbers();
        let skips_zeros_of_b = !skips_zeros_of_a && b.shape.len() == 2 && b.is_of_numbers();
        if a.is_of_numbers() && b.is_of_numbers() {
            return refuse(
                part,
                "a product of matrices of numbers is not read here: write its value",
            );
        }
        let (items_a, items_b) = (a.items.borrow().clone(), b.items.borrow().clone());
        let at = |row: usize, column: usize, k: usize| {
            (&items_a[row * inner + k], &items_b[k * columns + column])
        };
        let mut found = vec![Value::float(0.0); rows * columns];
        // Column by column where the second factor is the matrix of numbers: it is transposed then.
        let places: Vec<(usize, usize)> = match skips_zeros_of_b {
            false => (0..rows)
                .flat_map(|row| (0..columns).map(move |column| (row, column)))
                .collect(),
            true => (0..columns)
                .flat_map(|column| (0..rows).map(move |row| (row, column)))
                .collect(),
        };
        for (row, column) in places {
            let mut total: Option<Value> = None;
            for k in 0..inner {
                let (left, right) = at(row, column, k);
                let (coefficient, value) = match skips_zeros_of_b {
                    true => (right, left),
                    false => (left, right),
                };
                let term = match (skips_zeros_of_a || skips_zeros_of_b, coefficient.number()) {
                    (true, Some(0.0)) => continue,
                    (true, Some(1.0)) => value.clone(),
                    (true, Some(number)) => {
                        self.operation(part, Operator::Mult, &Value::float(number), value)?
                    }
                    _ => self.operation(part, Operator::Mult, left, right)?,
                };
                total = Some(match total {
                    None => term,
                    Some(total) => self.operation(part, Operator::Add, &total, &term)?,
                });
            }
            found[row * columns + column] = total.unwrap_or_else(|| Value::float(0.0));
        }
        let mut shape = a.shape[..a.shape.len() - 1].to_vec();
        shape.extend(&b.shape[1..]);
        match shape.is_empty() {
            true => Ok(found.remove(0)),
            false => Ok(Value::Array(Array::new(shape, found, is_traced))),
        }
    }

    /// `values[index]`.
    pub fn entry(&mut self, values: &Expr, index: &Expr) -> Result<Value, Refused> {
        match self.value(values)? {
            Value::List(list) => {
                let count = list.items.borrow().len();
                let items = |places: Vec<usize>| {
                    let items = list.items.borrow();
                    places
                        .into_iter()
                        .map(|place| items[place].clone())
                        .collect::<Vec<_>>()
                };
                match self.taken(index, count)? {
                    Taken::One(place) => Ok(list.items.borrow()[place].clone()),
                    Taken::Some(places) if list.is_tuple => Ok(Value::tuple(items(places))),
                    Taken::Some(places) => Ok(Value::list(items(places))),
                }
            }
            Value::Array(array) => self.part_of(&array, index),
            Value::Dict(pairs) => {
                let key = self.value(index)?;
                let is_key = |known: &Value| match (known, &key) {
                    (Value::Text(a), Value::Text(b)) => a == b,
                    (a, b) => a.number().is_some() && a.number() == b.number(),
                };
                let found = pairs.iter().find(|(known, _)| is_key(known));
                match found {
                    Some((_, value)) => Ok(value.clone()),
                    None => refuse(index, "the dict has no such entry"),
                }
            }
            _ => refuse(values, "a number has no entries"),
        }
    }

    /// Entries of an array, by an index for each of its axes.
    fn part_of(&mut self, array: &Rc<Array>, index: &Expr) -> Result<Value, Refused> {
        let indices: Vec<&Expr> = match index {
            Expr::Tuple(tuple) => tuple.elts.iter().collect(),
            single => vec![single],
        };
        if indices.len() > array.shape.len() {
            return refuse(index, "more indices than the array has axes");
        }
        if let ([single], Some(numbers), 1) = (&indices[..], array.numbers(), array.shape.len()) {
            if !single.is_slice_expr() {
                if let Value::Node(node) = self.value(single)? {
                    self.tracer.place = single.range();
                    return Ok(Value::Node(lookup(self.tracer, node, &numbers)?));
                }
            }
        }
        let mut taken = Vec::new();
        for (k, &count) in array.shape.iter().enumerate() {
            taken.push(match indices.get(k) {
                Some(index) => self.taken(index, count)?,
                None => Taken::Some((0..count).collect()),
            });
        }
        if taken.iter().any(|taken| matches!(taken, Taken::Some(_))) {
            // A part of an array is a view: what is assigned to one of the two is seen in the other.
            array.is_fixed.set(true);
        }
        let items = array.items.borrow();
        let shape: Vec<usize> = taken
            .iter()
            .filter_map(|taken| match taken {
                Taken::One(_) => None,
                Taken::Some(places) => Some(places.len()),
            })
            .collect();
        let places = |taken: &Taken| match taken {
            Taken::One(place) => vec![*place],
            Taken::Some(places) => places.clone(),
        };
        let found: Vec<Value> = match &taken[..] {
            [first] => places(first)
                .into_iter()
                .map(|k| items[k].clone())
                .collect(),
            [rows, columns] => {
                let width = array.shape[1];
                let columns = places(columns);
                let of_row = |row: usize| columns.iter().map(move |column| row * width + column);
                let all = places(rows).into_iter().flat_map(of_row);
                all.map(|k| items[k].clone()).collect()
            }
            _ => return refuse(index, "arrays have one or two axes"),
        };
        match (shape.is_empty(), found.first()) {
            (true, Some(value)) => Ok(value.clone()),
            _ => Ok(Value::Array(Array::new(shape, found, array.is_traced))),
        }
    }

    fn taken(&mut self, index: &Expr, count: usize) -> Result<Taken, Refused> {
        if let Expr::Slice(slice) = index {
            return Ok(Taken::Some(self.places_of(slice, count)?));
        }
        let value = self.value(index)?;
        let place = match value {
            Value::Node(node) => self.tracer.known_integer(node).map(|place| place as f64),
            Value::Number {
                value,
                is_whole: true,
            } => Some(value),
            Value::Truth(holds) => Some(f64::from(u8::from(holds))),
            Value::Condition(condition) => {
                Some(f64::from(u8::from(self.tracer.decide(&condition))))
            }
            _ => None,
        };
        let Some(place) = place else {
            return refuse(index, "an index is a whole number, or a slice");
        };
        let place = if place < 0.0 {
            place + count as f64
        } else {
            place
        };
        match place >= 0.0 && place < count as f64 {
            true => Ok(Taken::One(place as usize)),
            false => refuse(index, format!("there are {count} entries, from index 0")),
        }
    }

    fn places_of(&mut self, slice: &ExprSlice, count: usize) -> Result<Vec<usize>, Refused> {
        let mut bound = |bound: &Option<Box<Expr>>| match bound.as_deref() {
            None => Ok(None),
            Some(Expr::NoneLiteral(_)) => Ok(None),
            Some(bound) => Ok(Some(self.whole_number(bound)?)),
        };
        let (lower, upper, step) = (
            bound(&slice.lower)?,
            bound(&slice.upper)?,
            bound(&slice.step)?,
        );
        let (step, n) = (step.unwrap_or(1), count as i64);
        if step == 0 {
            return refuse(slice, "the step of a slice is not 0");
        }
        let end = |bound: Option<i64>, default: i64| match bound {
            None => default,
            Some(bound) => {
                let bound = if bound < 0 { bound + n } else { bound };
                match step > 0 {
                    true => bound.clamp(0, n),
                    false => bound.clamp(-1, n - 1),
                }
            }
        };
        let (mut at, stop) = match step > 0 {
            true => (end(lower, 0), end(upper, n)),
            false => (end(lower, n - 1), end(upper, -1)),
        };
        let mut places = Vec::new();
        while if step > 0 { at < stop } else { at > stop } {
            places.push(at as usize);
            at += step;
        }
        Ok(places)
    }

    /// A whole number of Python.
    pub fn whole_number(&mut self, expression: &Expr) -> Result<i64, Refused> {
        match self.value(expression)? {
            Value::Number {
                value,
                is_whole: true,
            } => Ok(value as i64),
            _ => refuse(expression, "a whole number is needed"),
        }
    }

    /// `values[index] = value`.
    pub fn assign_entry(
        &mut self,
        values: &Expr,
        index: &Expr,
        value: &Value,
    ) -> Result<(), Refused> {
        const KEPT: &str = "only arrays and lists that are made in the function can be changed";
        match self.value(values)? {
            Value::List(list) if !list.is_fixed.get() => {
                let count = list.items.borrow().len();
                match self.taken(index, count)? {
                    Taken::One(place) => list.items.borrow_mut()[place] = value.clone(),
                    Taken::Some(_) => return refuse(index, "slices of lists are not assigned to"),
                }
                Ok(())
            }
            Value::Array(array) => {
                if array.is_fixed.get() {
                    let error = format!("{KEPT}, and none of which a part was taken");
                    return refuse(values, error);
                }
                let is_whole = |item: &Value| matches!(item, Value::Number { is_whole: true, .. });
                if array.items.borrow().iter().any(is_whole) {
                    return refuse(
                        values,
                        "an array of whole numbers rounds what is assigned to it",
                    );
                }
                let indices: Vec<&Expr> = match index {
                    Expr::Tuple(tuple) => tuple.elts.iter().collect(),
                    single => vec![single],
                };
                if indices.len() != array.shape.len() {
                    return refuse(index, "one index for each axis is needed");
                }
                let taken = indices
                    .iter()
                    .zip(&array.shape)
                    .map(|(index, &count)| self.taken(index, count))
                    .collect::<Result<Vec<_>, _>>()?;
                let places: Vec<usize> = match &taken[..] {
                    [Taken::One(place)] => vec![*place],
                    [Taken::Some(places)] => places.clone(),
                    [Taken::One(row), Taken::One(column)] => vec![row * array.shape[1] + column],
                    _ => return refuse(index, "parts of matrices are not assigned to"),
                };
                let given = match value {
                    Value::Array(_) | Value::List(_) => {
                        let given = as_array(index, value)?;
                        if given.shape != [places.len()] {
                            return refuse(
                                index,
                                "the numbers assigned are as many as their places",
                            );
                        }
                        let items = given.items.borrow().clone();
                        items
                    }
                    scalar => vec![scalar.clone(); places.len()],
                };
                let as_float = |value: Value| match value {
                    Value::Number { value, .. } => Value::float(value),
                    other => other,
                };
                let mut items = array.items.borrow_mut();
                for (place, value) in places.into_iter().zip(given) {
                    items[place] = as_float(value);
                }
                Ok(())
            }
            _ => refuse(values, KEPT),
        }
    }
}

/// A list as an array, an array as it is.
pub fn as_array(part: &impl Ranged, value: &Value) -> Result<Rc<Array>, Refused> {
    match value {
        Value::Array(array) => Ok(Rc::clone(array)),
        other => array_of(part, other),
    }
}

/// The items of a list or of an array with one axis; the rows of one with two.
pub fn items_of(part: &impl Ranged, value: &Value) -> Result<Vec<Value>, Refused> {
    match value {
        Value::List(list) => Ok(List::items(list)),
        Value::Array(array) => {
            let items = array.items.borrow();
            match array.shape[..] {
                [_] => Ok(items.clone()),
                [_, width] => {
                    let row = |row: &[Value]| {
                        Value::Array(Array::new(vec![width], row.to_vec(), array.is_traced))
                    };
                    Ok(items.chunks(width.max(1)).map(row).collect())
                }
                _ => refuse(part, "arrays have one or two axes"),
            }
        }
        Value::Dict(pairs) => Ok(pairs.iter().map(|(key, _)| key.clone()).collect()),
        _ => refuse(part, "a list or an array is needed"),
    }
}
