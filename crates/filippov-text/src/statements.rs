//! Statements, on one path.

use std::collections::BTreeMap;

use filippov_expr::NodeId;
use ruff_python_ast::{Expr, Stmt, StmtFunctionDef};

use crate::module::Module;
use crate::tracer::Tracer;
use crate::unreadable::{refuse, Refused};
use crate::values::Value;

/// Reads a body, or a part of one.
pub struct Reader<'a> {
    pub tracer: &'a mut Tracer,
    pub module: &'a Module,
    pub names: BTreeMap<String, Value>,
}

impl<'a> Reader<'a> {
    pub fn new(tracer: &'a mut Tracer, module: &'a Module) -> Self {
        Reader {
            tracer,
            module,
            names: BTreeMap::new(),
        }
    }

    /// The nodes of the field that a function of n states returns on this path.
    pub fn field(&mut self, def: &StmtFunctionDef, n: usize) -> Result<Vec<NodeId>, Refused> {
        let Some((value, part)) = self.run(&def.body)? else {
            return refuse(
                &def.name,
                "the function returns nothing: is a `return` missing?",
            );
        };
        let values = match value {
            Value::List(values) => values,
            single => vec![single],
        };
        if values.len() != n {
            let error = format!("{} values are returned for {n} states", values.len());
            return refuse(part, error);
        }
        let nodes = values.iter().map(|value| self.tracer.node(part, value));
        nodes.collect()
    }

    /// Runs statements up to a `return`.
    fn run<'s>(&mut self, body: &'s [Stmt]) -> Result<Option<(Value, &'s Expr)>, Refused> {
        for statement in body {
            match statement {
                Stmt::Return(found) => {
                    let Some(value) = found.value.as_deref() else {
                        return refuse(found, "a `return` without a value");
                    };
                    return Ok(Some((self.value(value)?, value)));
                }
                Stmt::Assign(assign) => {
                    let value = self.value(&assign.value)?;
                    for target in &assign.targets {
                        self.bind(target, &value)?;
                    }
                }
                Stmt::AugAssign(assign) => {
                    let before = self.value(&assign.target)?;
                    let operand = self.value(&assign.value)?;
                    let value = self.operation(assign, assign.op, &before, &operand)?;
                    self.bind(&assign.target, &value)?;
                }
                Stmt::If(chain) => {
                    let mut branch = None;
                    if self.holds(&chain.test)? {
                        branch = Some(&chain.body);
                    } else {
                        for clause in &chain.elif_else_clauses {
                            let is_taken = match &clause.test {
                                Some(test) => self.holds(test)?,
                                None => true,
                            };
                            if is_taken {
                                branch = Some(&clause.body);
                                break;
                            }
                        }
                    }
                    if let Some(body) = branch {
                        if let Some(returned) = self.run(body)? {
                            return Ok(Some(returned));
                        }
                    }
                }
                Stmt::Pass(_) => {}
                Stmt::Expr(text) if text.value.is_string_literal_expr() => {}
                other => return refuse(other, what_it_is(other)),
            }
        }
        Ok(None)
    }

    fn bind(&mut self, target: &Expr, value: &Value) -> Result<(), Refused> {
        let targets = match target {
            Expr::Name(name) => {
                self.names.insert(name.id.to_string(), value.clone());
                return Ok(());
            }
            Expr::Tuple(tuple) => &tuple.elts,
            Expr::List(list) => &list.elts,
            other => {
                let error =
                    "only names are assigned to, not parts of arrays or objects: return a tuple";
                return refuse(other, error);
            }
        };
        let Value::List(values) = value else {
            return refuse(target, "one number cannot be unpacked");
        };
        if targets.len() != values.len() {
            let error = format!("{} values for {} names", values.len(), targets.len());
            return refuse(target, error);
        }
        let mut pairs = targets.iter().zip(values);
        pairs.try_for_each(|(target, value)| self.bind(target, value))
    }
}

fn what_it_is(statement: &Stmt) -> &'static str {
    match statement {
        Stmt::For(_) | Stmt::While(_) => "a loop is not read here: write its turns out",
        Stmt::FunctionDef(_) | Stmt::ClassDef(_) => {
            "a function or a class in the function is not read here"
        }
        Stmt::AnnAssign(_) => "an annotation is not read here: write `name = value`",
        Stmt::Import(_) | Stmt::ImportFrom(_) => "an import belongs above the function",
        Stmt::Try(_) | Stmt::Raise(_) | Stmt::Assert(_) => "exceptions are not read here",
        Stmt::With(_) => "`with` is not read here",
        Stmt::Global(_) | Stmt::Nonlocal(_) => "names outside of the function cannot be changed",
        Stmt::Expr(_) => "an expression whose value is not used is not read here",
        _ => "this statement is not read here",
    }
}
