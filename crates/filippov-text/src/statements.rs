//! Statements, on one path.

use std::rc::Rc;

use ruff_python_ast::{Expr, Stmt, StmtIf};

use crate::arrays::items_of;
use crate::reader::Reader;
use crate::unreadable::{refuse, Refused};
use crate::values::Value;

/// Turns of a `while` whose end the state may decide.
const MOST_TURNS_OF_WHILE: usize = 2000;

/// How statements end.
pub enum Flow {
    /// At their last one.
    Next,
    Return(Value),
    Break,
    Continue,
}

impl Reader<'_> {
    /// Runs statements up to a `return`.
    pub fn run(&mut self, body: &[Stmt]) -> Result<Flow, Refused> {
        for statement in body {
            self.take_turn(statement)?;
            match self.run_one(statement)? {
                Flow::Next => {}
                ended => return Ok(ended),
            }
        }
        Ok(Flow::Next)
    }

    fn run_one(&mut self, statement: &Stmt) -> Result<Flow, Refused> {
        match statement {
            Stmt::Return(found) => {
                let value = match found.value.as_deref() {
                    Some(value) => self.value(value)?,
                    None => Value::Nothing,
                };
                return Ok(Flow::Return(value));
            }
            Stmt::Assign(assign) => {
                let value = self.value(&assign.value)?;
                for target in &assign.targets {
                    self.bind(target, &value)?;
                }
            }
            Stmt::AnnAssign(assign) => {
                if let Some(value) = &assign.value {
                    let value = self.value(value)?;
                    self.bind(&assign.target, &value)?;
                }
            }
            Stmt::AugAssign(assign) => {
                let before = self.value(&assign.target)?;
                if matches!(before, Value::List(_) | Value::Array(_)) {
                    let error =
                        "a list or an array is not changed in place here: write `a = a + b`";
                    return refuse(assign, error);
                }
                let operand = self.value(&assign.value)?;
                let value = self.operation(assign, assign.op, &before, &operand)?;
                self.bind(&assign.target, &value)?;
            }
            Stmt::If(chain) => {
                if let Some(body) = self.branch(chain)? {
                    return self.run(body);
                }
            }
            Stmt::For(turns) => {
                let values = self.value(&turns.iter)?;
                for value in items_of(&*turns.iter, &values)? {
                    self.take_turn(turns)?;
                    self.bind(&turns.target, &value)?;
                    match self.run(&turns.body)? {
                        Flow::Next | Flow::Continue => {}
                        Flow::Break => return Ok(Flow::Next),
                        ended => return Ok(ended),
                    }
                }
                return self.run(&turns.orelse);
            }
            Stmt::While(turns) => {
                let mut n_turns = 0;
                while self.holds(&turns.test)? {
                    self.take_turn(turns)?;
                    n_turns += 1;
                    if n_turns > MOST_TURNS_OF_WHILE {
                        return refuse(turns, "a loop whose length depends on the state");
                    }
                    match self.run(&turns.body)? {
                        Flow::Next | Flow::Continue => {}
                        Flow::Break => return Ok(Flow::Next),
                        ended => return Ok(ended),
                    }
                }
                return self.run(&turns.orelse);
            }
            Stmt::Break(_) => return Ok(Flow::Break),
            Stmt::Continue(_) => return Ok(Flow::Continue),
            Stmt::Pass(_) => {}
            Stmt::FunctionDef(def) if def.decorator_list.is_empty() => {
                let function = Value::Function(Rc::new(self.callable(def)?));
                self.scope.set(def.name.as_str(), function);
            }
            Stmt::Expr(text) if text.value.is_string_literal_expr() => {}
            Stmt::Expr(call) => match &*call.value {
                Expr::Call(call) if self.appends(call)? => {}
                _ => {
                    return refuse(
                        call,
                        "an expression whose value is not used is not read here",
                    )
                }
            },
            other => return refuse(other, what_it_is(other)),
        }
        Ok(Flow::Next)
    }

    /// The body that is run, if one is.
    fn branch<'s>(&mut self, chain: &'s StmtIf) -> Result<Option<&'s [Stmt]>, Refused> {
        if self.holds(&chain.test)? {
            return Ok(Some(&chain.body));
        }
        for clause in &chain.elif_else_clauses {
            let is_taken = match &clause.test {
                Some(test) => self.holds(test)?,
                None => true,
            };
            if is_taken {
                return Ok(Some(&clause.body));
            }
        }
        Ok(None)
    }

    pub fn bind(&mut self, target: &Expr, value: &Value) -> Result<(), Refused> {
        let targets = match target {
            Expr::Name(name) => {
                self.scope.set(name.id.as_str(), value.clone());
                return Ok(());
            }
            Expr::Tuple(tuple) => &tuple.elts,
            Expr::List(list) => &list.elts,
            Expr::Subscript(part) => return self.assign_entry(&part.value, &part.slice, value),
            other => return refuse(other, "this is not assigned to here: return a tuple"),
        };
        if !matches!(value, Value::List(_) | Value::Array(_)) {
            return refuse(target, "one number cannot be unpacked");
        }
        let values = items_of(target, value)?;
        let star = targets.iter().position(Expr::is_starred_expr);
        let n_named = targets.len() - usize::from(star.is_some());
        if values.len() < n_named || star.is_none() && values.len() > n_named {
            let error = format!("{} values for {} names", values.len(), targets.len());
            return refuse(target, error);
        }
        let n_rest = values.len() - n_named;
        let mut values = values.into_iter();
        for target in targets {
            match target {
                Expr::Starred(rest) => {
                    let rest_values = values.by_ref().take(n_rest).collect();
                    self.bind(&rest.value, &Value::list(rest_values))?;
                }
                target => {
                    if let Some(value) = values.next() {
                        self.bind(target, &value)?;
                    }
                }
            }
        }
        Ok(())
    }
}

pub fn what_it_is(statement: &Stmt) -> &'static str {
    match statement {
        Stmt::FunctionDef(_) => "a function with a decorator is read as the model only",
        Stmt::ClassDef(_) => "a class is not read here",
        Stmt::Import(_) | Stmt::ImportFrom(_) => "an import belongs above the function",
        Stmt::Try(_) | Stmt::Raise(_) | Stmt::Assert(_) => "exceptions are not read here",
        Stmt::With(_) => "`with` is not read here",
        Stmt::Global(_) | Stmt::Nonlocal(_) => "names outside of the function cannot be changed",
        _ => "this statement is not read here",
    }
}
