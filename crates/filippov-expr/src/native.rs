//! Native code by Cranelift. The only file of the crate with `unsafe`: calling the code, and freeing it.
//!
//! One function per program, generic in the signs, with the C signature of [`CompiledFunction`]; a large program is a
//! chain of such functions, which hand values on in a buffer. What is
//! not a machine instruction is a call of the same Rust function that the interpreter uses
//! ([`UnaryOp::apply`], [`BinaryOp::apply`]), and Cranelift neither contracts nor reorders floating-point
//! operations: both backends give the same bits.

use std::cell::RefCell;
use std::ops::Range;
use std::sync::{Mutex, OnceLock};

use cranelift_codegen::ir::condcodes::FloatCC;
use cranelift_codegen::ir::{types, AbiParam, FuncRef, InstBuilder, MemFlagsData, Value};
use cranelift_codegen::isa::OwnedTargetIsa;
use cranelift_codegen::settings::{self, Configurable};
use cranelift_frontend::{FunctionBuilder, FunctionBuilderContext};
use cranelift_jit::{JITBuilder, JITModule};
use cranelift_module::{default_libcall_names, FuncId, Linkage, Module};
use rustc_hash::FxHashMap;

use crate::error::ExprError;
use crate::graph::Graph;
use crate::node::{Node, NodeId};
use crate::op::{BinaryOp, UnaryOp};
use crate::schedule::Schedule;
use crate::tape::{Arguments, Tape};

/// Programs of more nodes are made of functions of this many, with the fast register allocator: the better one takes more than
/// linear time (29 s for 10^5 nodes) and gains some ten per cent. The stack frame of a function grows with its nodes: this one has
/// at most 32 KiB, which fits into the cache, and into the stack of any thread.
const CHUNK: usize = 4_096;

/// (t, x, s, p, v, out, handed on); the pointers are to as many numbers as the program's `Lengths` say, the last one to as many as
/// are handed on from one function to another.
type CompiledFunction =
    unsafe extern "C" fn(f64, *const f64, *const f64, *const f64, *const f64, *mut f64, *mut f64);

thread_local! {
    /// What is handed on, kept between calls so that evaluation does not allocate.
    static HANDED_ON: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

/// A program in native code: one function.
pub(crate) struct NativeCode {
    function: CompiledFunction,
    /// Keeps the memory of the function.
    _module: OwnedModule,
}

/// A large program in native code: functions, called in their order. It is not a case of [`NativeCode`], so that a call of that is a
/// call of its function and nothing else.
pub(crate) struct NativeChain {
    functions: Vec<CompiledFunction>,
    n_handed_on: usize,
    /// Keeps the memory of the functions.
    _module: OwnedModule,
}

/// What a program is compiled to.
pub(crate) enum Compiled {
    Whole(NativeCode),
    Chain(NativeChain),
}

impl NativeCode {
    /// Does it work on this platform?
    pub fn is_available() -> bool {
        passes_self_test()
    }

    /// Runs the program; the caller has checked the lengths.
    #[inline(always)]
    pub fn run(&self, arguments: Arguments<'_>, out: &mut [f64]) {
        call(self.function, arguments, out, std::ptr::null_mut());
    }
}

impl NativeChain {
    /// Runs the program; the caller has checked the lengths.
    pub fn run(&self, arguments: Arguments<'_>, out: &mut [f64]) {
        HANDED_ON.with_borrow_mut(|handed_on| {
            if handed_on.len() < self.n_handed_on {
                handed_on.resize(self.n_handed_on, 0.0);
            }
            let handed_on = handed_on.as_mut_ptr();
            for &function in &self.functions {
                call(function, arguments, out, handed_on);
            }
        });
    }
}

impl Compiled {
    /// Compiles a scheduled program.
    pub fn new(graph: &Graph, schedule: &Schedule) -> Result<Self, ExprError> {
        if !passes_self_test() {
            return unavailable("the self-test on this platform failed");
        }
        compile_in_chunks(graph, schedule, CHUNK)
    }

    fn run(&self, arguments: Arguments<'_>, out: &mut [f64]) {
        match self {
            Compiled::Whole(code) => code.run(arguments, out),
            Compiled::Chain(chain) => chain.run(arguments, out),
        }
    }
}

/// Calls one function of a program, with the lengths of the program.
#[inline(always)]
fn call(
    function: CompiledFunction,
    arguments: Arguments<'_>,
    out: &mut [f64],
    handed_on: *mut f64,
) {
    let Arguments { t, x, s, p, v } = arguments;
    // SAFETY: the code was made by `compile_in_chunks` for this signature and lives as long as the `_module` of the `NativeCode`
    // or the `NativeChain` whose method called this. It reads x, s, p, v below the program's `Lengths` and writes `out` below its number of outputs,
    // which `Program::eval`, the only caller beside the self-test, has compared with the slices. It reads and writes `handed_on`
    // below `n_handed_on`, which is not null where that is not 0.
    unsafe {
        function(
            t,
            x.as_ptr(),
            s.as_ptr(),
            p.as_ptr(),
            v.as_ptr(),
            out.as_mut_ptr(),
            handed_on,
        )
    }
}

impl std::fmt::Debug for NativeCode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NativeCode").finish_non_exhaustive()
    }
}

impl std::fmt::Debug for NativeChain {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("NativeChain").finish_non_exhaustive()
    }
}

/// The module with the code in memory, which would leak if it were only dropped. The mutex makes it
/// shareable; it is never locked.
struct OwnedModule(Mutex<Option<Box<JITModule>>>);

impl Drop for OwnedModule {
    fn drop(&mut self) {
        let module = match self.0.get_mut() {
            Ok(module) => module.take(),
            Err(poisoned) => poisoned.into_inner().take(),
        };
        if let Some(module) = module {
            // SAFETY: the function pointers into this memory are in the code that owns this module
            // and are not handed out; being dropped, it is not running.
            unsafe { module.free_memory() }
        }
    }
}

fn unavailable<T>(reason: impl ToString) -> Result<T, ExprError> {
    Err(ExprError::NativeUnavailable {
        reason: reason.to_string(),
    })
}

/// The description of this machine, made once for each register allocator.
fn target(single_pass: bool) -> Result<OwnedTargetIsa, ExprError> {
    static TARGETS: [OnceLock<Result<OwnedTargetIsa, String>>; 2] =
        [OnceLock::new(), OnceLock::new()];
    let allocator = if single_pass {
        "single_pass"
    } else {
        "backtracking"
    };
    let describe = || -> Result<OwnedTargetIsa, String> {
        let mut flags = settings::builder();
        for (name, value) in [
            ("opt_level", "speed"),
            ("regalloc_algorithm", allocator),
            ("is_pic", "false"),
            ("use_colocated_libcalls", "false"),
            ("enable_verifier", "false"),
            ("unwind_info", "false"), // nothing unwinds through the code: what it calls cannot panic
            ("enable_probestack", "true"),
            ("probestack_strategy", "inline"),
        ] {
            flags.set(name, value).map_err(|error| error.to_string())?;
        }
        let machine = cranelift_native::builder()?;
        machine
            .finish(settings::Flags::new(flags))
            .map_err(|error| error.to_string())
    };
    match TARGETS[usize::from(single_pass)].get_or_init(describe) {
        Ok(target) => Ok(target.clone()),
        Err(reason) => unavailable(reason),
    }
}

/// Compiles a program into functions of so many nodes.
fn compile_in_chunks(
    graph: &Graph,
    schedule: &Schedule,
    chunk: usize,
) -> Result<Compiled, ExprError> {
    let target = target(schedule.order.len() > chunk)?;
    let mut builder = JITBuilder::with_isa(target, default_libcall_names());
    let called = called_operations(graph, schedule);
    builder.symbols(
        called
            .iter()
            .map(|operation| (operation.symbol(), operation.address())),
    );

    let mut owner = OwnedModule(Mutex::new(Some(Box::new(JITModule::new(builder)))));
    let Ok(Some(module)) = owner.0.get_mut() else {
        return unavailable("the module is gone");
    };
    let handed_on = handed_on(graph, schedule, chunk);
    let ids = match define(module, graph, schedule, &called, (chunk, &handed_on)) {
        Ok(ids) => ids,
        Err(error) => return unavailable(error),
    };
    let functions = ids.into_iter().map(|id| {
        let address = module.get_finalized_function(id);
        // SAFETY: `define` gave every function exactly this signature, in the C convention of this machine.
        unsafe { std::mem::transmute::<*const u8, CompiledFunction>(address) }
    });
    let functions: Vec<CompiledFunction> = functions.collect();
    Ok(match functions[..] {
        [function] => Compiled::Whole(NativeCode {
            function,
            _module: owner,
        }),
        _ => Compiled::Chain(NativeChain {
            functions,
            n_handed_on: handed_on.len(),
            _module: owner,
        }),
    })
}

/// The values that are used in other chunks than those that compute them, each with its place in the buffer. Variables and
/// constants are read anew.
fn handed_on(graph: &Graph, schedule: &Schedule, chunk: usize) -> FxHashMap<NodeId, u32> {
    let mut places = FxHashMap::default();
    if schedule.order.len() <= chunk {
        return places;
    }
    for (position, &id) in schedule.order.iter().enumerate() {
        let last_use = schedule.last_use.get(&id).copied().unwrap_or(position);
        if last_use / chunk > position / chunk && is_computed(graph.node(id)) {
            places.insert(id, places.len() as u32);
        }
    }
    places
}

fn is_computed(node: &Node) -> bool {
    node.operands().next().is_some()
}

/// Translates the program into functions of the module, one per chunk, and makes them executable.
fn define(
    module: &mut JITModule,
    graph: &Graph,
    schedule: &Schedule,
    called: &[Operation],
    (chunk, handed_on): (usize, &FxHashMap<NodeId, u32>),
) -> Result<Vec<FuncId>, Box<cranelift_module::ModuleError>> {
    let pointer = module.target_config().pointer_type();
    let mut imported = Vec::new();
    for &operation in called {
        let mut signature = module.make_signature();
        signature
            .params
            .extend(vec![AbiParam::new(types::F64); operation.n_operands()]);
        signature.returns.push(AbiParam::new(types::F64));
        let import = module
            .declare_function(operation.symbol(), Linkage::Import, &signature)
            .map_err(Box::new)?;
        imported.push((operation, import));
    }
    let mut context = module.make_context();
    let mut function_context = FunctionBuilderContext::new();
    let mut ids = Vec::new();
    let n_nodes = schedule.order.len();
    for first in (0..n_nodes.max(1)).step_by(chunk) {
        let signature = &mut context.func.signature;
        signature.params.push(AbiParam::new(types::F64));
        signature.params.extend([AbiParam::new(pointer); 6]);
        let id = module
            .declare_anonymous_function(&context.func.signature)
            .map_err(Box::new)?;
        let imports = imported.iter().map(|&(operation, import)| {
            let reference = module.declare_func_in_func(import, &mut context.func);
            (operation, reference)
        });
        let imports = imports.collect();
        let mut builder = FunctionBuilder::new(&mut context.func, &mut function_context);
        let block = builder.create_block();
        builder.append_block_params_for_function_params(block);
        builder.switch_to_block(block);
        builder.seal_block(block);
        Translation::new(builder, imports, handed_on)
            .translate(graph, schedule, first..n_nodes.min(first + chunk))
            .finalize(module.target_config());
        module.define_function(id, &mut context).map_err(Box::new)?;
        module.clear_context(&mut context);
        ids.push(id);
    }
    module.finalize_definitions().map_err(Box::new)?;
    Ok(ids)
}

/// An operation that is a call, not an instruction.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Operation {
    Unary(UnaryOp),
    Binary(BinaryOp),
}

impl Operation {
    /// The operation of a node, if it takes a call.
    fn of(node: &Node) -> Option<Self> {
        match *node {
            Node::Unary(UnaryOp::Neg | UnaryOp::Sqrt, _) => None,
            Node::Unary(op, _) => Some(Operation::Unary(op)),
            Node::Binary(op @ (BinaryOp::Pow | BinaryOp::Atan2 | BinaryOp::Hypot), ..) => {
                Some(Operation::Binary(op))
            }
            _ => None,
        }
    }

    fn n_operands(self) -> usize {
        match self {
            Operation::Unary(_) => 1,
            Operation::Binary(_) => 2,
        }
    }

    fn symbol(self) -> &'static str {
        match self {
            Operation::Unary(op) => op.name(),
            Operation::Binary(op) => op.name(),
        }
    }

    fn address(self) -> *const u8 {
        match self {
            Operation::Unary(op) => unary_function(op) as *const u8,
            Operation::Binary(op) => binary_function(op) as *const u8,
        }
    }
}

/// Each operation that the program calls, once.
fn called_operations(graph: &Graph, schedule: &Schedule) -> Vec<Operation> {
    let mut called = Vec::new();
    for operation in schedule
        .order
        .iter()
        .filter_map(|&id| Operation::of(graph.node(id)))
    {
        if !called.contains(&operation) {
            called.push(operation);
        }
    }
    called
}

/// The C functions of the listed operations: `apply` with the operation fixed.
macro_rules! c_functions {
    ($op:expr, $kind:ident, $parameters:tt, $operands:tt, $type:ty, [$($name:ident),+]) => {
        match $op {
            $($kind::$name => {
                extern "C" fn function $parameters -> f64 {
                    $kind::$name.apply $operands
                }
                function as $type
            })+
        }
    };
}

fn unary_function(op: UnaryOp) -> extern "C" fn(f64) -> f64 {
    c_functions!(op, UnaryOp, (a: f64), (a), extern "C" fn(f64) -> f64, [
        Neg, Sqrt, Cbrt, Exp, Expm1, Exp2, Log, Log1p, Log2, Log10, Sin, Cos, Tan, Asin, Acos, Atan, Sinh, Cosh,
        Tanh, Asinh, Acosh, Atanh, NotNegative, Erf
    ])
}

fn binary_function(op: BinaryOp) -> extern "C" fn(f64, f64) -> f64 {
    c_functions!(op, BinaryOp, (a: f64, b: f64), (a, b), extern "C" fn(f64, f64) -> f64, [Add, Sub, Mul, Div, Pow, Atan2, Hypot])
}

/// The body of the function while it is written.
struct Translation<'a> {
    builder: FunctionBuilder<'a>,
    imports: FxHashMap<Operation, FuncRef>,
    handed_on: &'a FxHashMap<NodeId, u32>,
    /// t, x, s, p, v, out, handed on
    parameters: [Value; 7],
    values: FxHashMap<NodeId, Value>,
    /// s_j > 0, by surface.
    conditions: FxHashMap<u32, Value>,
}

impl<'a> Translation<'a> {
    fn new(
        builder: FunctionBuilder<'a>,
        imports: FxHashMap<Operation, FuncRef>,
        handed_on: &'a FxHashMap<NodeId, u32>,
    ) -> Self {
        let mut parameters = [Value::from_u32(0); 7];
        if let Some(block) = builder.current_block() {
            parameters.copy_from_slice(builder.block_params(block));
        }
        Translation {
            builder,
            imports,
            handed_on,
            parameters,
            values: FxHashMap::default(),
            conditions: FxHashMap::default(),
        }
    }

    /// Translates the nodes at these positions.
    fn translate(
        mut self,
        graph: &Graph,
        schedule: &Schedule,
        positions: Range<usize>,
    ) -> FunctionBuilder<'a> {
        let [.., out, handed_on] = self.parameters;
        let flags = MemFlagsData::trusted();
        let before = schedule
            .stores
            .partition_point(|store| store.0 < positions.start);
        let mut stores = schedule.stores[before..].iter().peekable();
        for position in positions {
            let id = schedule.order[position];
            let node = graph.node(id);
            for operand in node.operands() {
                self.recall(graph, operand);
            }
            let value = self.value(node);
            self.values.insert(id, value);
            if let Some(&place) = self.handed_on.get(&id) {
                let offset = offset(place);
                self.builder.ins().store(flags, value, handed_on, offset);
            }
            // Stored at once: the value need not stay alive to the end.
            while let Some(&&(_, output)) = stores.peek().filter(|store| store.0 == position) {
                let offset = offset(output);
                self.builder.ins().store(flags, value, out, offset);
                stores.next();
            }
        }
        self.builder.ins().return_(&[]);
        self.builder
    }

    /// Makes a value of an earlier chunk known in this one.
    fn recall(&mut self, graph: &Graph, id: NodeId) {
        if self.values.contains_key(&id) {
            return;
        }
        let value = match self.handed_on.get(&id) {
            None => self.value(graph.node(id)),
            Some(&place) => {
                let [.., handed_on] = self.parameters;
                let flags = MemFlagsData::trusted();
                let offset = offset(place);
                self.builder
                    .ins()
                    .load(types::F64, flags, handed_on, offset)
            }
        };
        self.values.insert(id, value);
    }

    fn value(&mut self, node: &Node) -> Value {
        let [t, x, s, p, v, ..] = self.parameters;
        match *node {
            Node::Constant(value) => self.builder.ins().f64const(value),
            Node::Time => t,
            Node::State(i) => self.load(x, i),
            Node::Sign(j) => self.load(s, j),
            Node::Parameter(i) => self.load(p, i),
            Node::Input(i) => self.load(v, i),
            Node::Unary(UnaryOp::Neg, a) => {
                let a = self.values[&a];
                self.builder.ins().fneg(a)
            }
            Node::Unary(UnaryOp::Sqrt, a) => {
                let a = self.values[&a];
                self.builder.ins().sqrt(a)
            }
            Node::Unary(op, a) => self.call(Operation::Unary(op), &[a]),
            Node::Binary(op, a, b) => {
                let (left, right) = (self.values[&a], self.values[&b]);
                match op {
                    BinaryOp::Add => self.builder.ins().fadd(left, right),
                    BinaryOp::Sub => self.builder.ins().fsub(left, right),
                    BinaryOp::Mul => self.builder.ins().fmul(left, right),
                    BinaryOp::Div => self.builder.ins().fdiv(left, right),
                    BinaryOp::Pow | BinaryOp::Atan2 | BinaryOp::Hypot => {
                        self.call(Operation::Binary(op), &[a, b])
                    }
                }
            }
            Node::Select {
                surface,
                plus,
                minus,
            } => {
                let condition = self.condition(surface);
                let (plus, minus) = (self.values[&plus], self.values[&minus]);
                self.builder.ins().select(condition, plus, minus)
            }
        }
    }

    fn condition(&mut self, surface: u32) -> Value {
        if let Some(&condition) = self.conditions.get(&surface) {
            return condition;
        }
        let [_, _, s, ..] = self.parameters;
        let sign = self.load(s, surface);
        let zero = self.builder.ins().f64const(0.0);
        let condition = self.builder.ins().fcmp(FloatCC::GreaterThan, sign, zero);
        self.conditions.insert(surface, condition);
        condition
    }

    /// The arguments do not change during a call, so equal loads are one.
    fn load(&mut self, array: Value, index: u32) -> Value {
        let flags = MemFlagsData::trusted().with_readonly();
        self.builder
            .ins()
            .load(types::F64, flags, array, offset(index))
    }

    fn call(&mut self, operation: Operation, operands: &[NodeId]) -> Value {
        let operands: Vec<Value> = operands
            .iter()
            .map(|operand| self.values[operand])
            .collect();
        let call = self.builder.ins().call(self.imports[&operation], &operands);
        self.builder.inst_results(call)[0]
    }
}

/// Byte offset of a number in an array; the schedule has checked that it fits.
fn offset(index: u32) -> i32 {
    (index * 8) as i32
}

/// Whether native code gives what the interpreter gives, tried once per process on every operation.
///
/// Some platforms refuse executable memory, and on others a code generator may be wrong: then programs
/// are interpreted.
fn passes_self_test() -> bool {
    static PASSED: OnceLock<bool> = OnceLock::new();
    *PASSED.get_or_init(|| std::panic::catch_unwind(self_test).unwrap_or(false))
}

fn self_test() -> bool {
    let mut graph = Graph::new();
    let variables = [
        graph.time(),
        graph.state(1),
        graph.parameter(0),
        graph.sign_of(2),
        graph.input(1),
    ];
    let mut outputs = variables.to_vec();
    for (k, &op) in UnaryOp::ALL.iter().enumerate() {
        outputs.push(graph.insert(Node::Unary(op, variables[k % variables.len()])));
    }
    for (k, &op) in BinaryOp::ALL.iter().enumerate() {
        let (a, b) = (outputs[k], outputs[k + 5]);
        outputs.push(graph.insert(Node::Binary(op, a, b)));
    }
    outputs.push(graph.select(2, 1.0, outputs[3], outputs[20]));
    let half = graph.constant(0.5);
    outputs.push(graph.select(0, 1.0, half, outputs[9]));

    let Ok(schedule) = Schedule::new(&graph, &outputs) else {
        return false;
    };
    // As one function, and as a chain of short ones.
    let (Ok(whole), Ok(chain)) = (
        compile_in_chunks(&graph, &schedule, CHUNK),
        compile_in_chunks(&graph, &schedule, 7),
    ) else {
        return false;
    };
    let tape = Tape::new(&graph, &schedule);
    [(0.25, 0.5, 1.0), (0.75, 1.5, -1.0), (-0.5, f64::NAN, 1.0)]
        .into_iter()
        .all(|(t, value, sign)| {
            let (x, s, p, v) = (
                [0.0, value],
                [-sign, 0.0, sign],
                [value + 0.125],
                [0.0, 0.25],
            );
            let arguments = Arguments {
                t,
                x: &x,
                s: &s,
                p: &p,
                v: &v,
            };
            let mut expected = vec![0.0; outputs.len()];
            tape.run(arguments, &mut expected);
            [&whole, &chain].into_iter().all(|native| {
                let mut found = vec![1.0; outputs.len()];
                native.run(arguments, &mut found);
                let mut pairs = expected.iter().zip(&found);
                pairs.all(|(a, b)| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan()))
            })
        })
}
