//! The script engine of one world: chosen packages, limits, our words, and the calls into scripts.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;
use std::time::Duration;

use rhai::packages::{
    ArithmeticPackage, BasicArrayPackage, BasicFnPackage, BasicIteratorPackage, BasicMapPackage, BasicMathPackage,
    BasicStringPackage, LogicPackage, MoreStringPackage, Package,
};
use rhai::{AST, ASTNode, Dynamic, Engine, EvalAltResult, Expr, FnPtr, Module, Position, Scope, Stmt};

use crate::error::{Fault, Known, Outcome, Problem, hint, problem_from};
use crate::limits::Limits;
use crate::reference::FunctionDoc;
use crate::source::Source;
use crate::stage::{Handler, Node, Stage};
use crate::words;
use umbriel_fields::canonical;

/// Stack for scripts: nesting of values is bounded by what fits onto it, see `weigh`. Only what is touched is used.
const STACK: usize = 512 << 20;

/// Runs scripts, and drops their values, on a stack that is deep enough for both.
pub(crate) fn on_deep_stack<T>(work: impl FnOnce() -> T) -> T {
    stacker::grow(STACK, work)
}

/// One world's script, ready to run, running, and being called back.
pub(crate) struct Script {
    engine: Engine,
    pub(crate) stage: Rc<Stage>,
    constants: Constants,
    docs: Vec<FunctionDoc>,
    /// What runs: the statements of the main script, all functions, those of the console too.
    ast: AST,
    scope: Scope<'static>,
}

type Constants = Rc<RefCell<BTreeMap<String, Dynamic>>>;

impl Script {
    /// An engine that works on a stage, without any text yet.
    pub(crate) fn new(stage: Rc<Stage>, world: Option<Node>) -> Self {
        let mut engine = Engine::new_raw();
        let constants = Constants::default();
        take_packages(&mut engine);
        set_limits(&mut engine, &stage.limits);
        set_hooks(&mut engine, &stage, &constants);
        set_constants(&mut engine, world);
        name_faults(&mut engine);
        let docs = words::teach(&mut engine, &stage);
        Self { engine, stage, constants, docs, ast: AST::empty(), scope: Scope::new() }
    }

    /// Parses and runs the main script.
    pub(crate) fn run(&mut self, source: Source) -> Result<(), Problem> {
        *self.stage.source.borrow_mut() = Rc::new(source);
        let source = self.stage.source.borrow().clone();
        self.ast = self.compile(&source.text).map_err(|e| self.problem(&e))?;
        self.functions_changed();
        let ast = self.ast.clone();
        self.evaluate(&ast).map(drop)
    }

    /// Runs one more text in the world that is there, with its variables; the value as text.
    pub(crate) fn console(&mut self, text: &str) -> Result<String, Problem> {
        let mut source = (**self.stage.source.borrow()).clone();
        let lines_before = source.text.lines().count();
        source.append_console(text, self.stage.limits.text)?;
        *self.stage.source.borrow_mut() = Rc::new(source);
        let shifted = "\n".repeat(lines_before) + text;
        let new = self.compile(&shifted).map_err(|e| self.problem(&e))?;
        let ast = self.ast.clone_functions_only().merge(&new);
        self.ast = ast.clone();
        self.functions_changed();
        self.stage.at_console.set(true);
        let result = self.evaluate(&ast);
        self.stage.at_console.set(false);
        let value = result?;
        if value.is_unit() {
            return Ok(String::new());
        }
        let text = || self.engine.eval_fn_call::<Dynamic>("to_string", None, (value,));
        self.guarded(self.stage.limits.handler, text).map(|text| text.to_string()).map_err(|error| self.problem(&error))
    }

    /// Expressions call the functions of the world: those of now.
    fn functions_changed(&self) {
        *self.stage.functions.borrow_mut() = self.ast.clone_functions_only();
        self.stage.compiled.borrow_mut().clear();
    }

    /// Runs what is no handler, but has a handler's time.
    pub(crate) fn within_handler(&self, run: impl FnOnce(&Engine) -> Outcome<Dynamic>) -> Outcome<Dynamic> {
        self.guarded(self.stage.limits.handler, || run(&self.engine))
    }

    /// The files that editors read; see [`crate::definitions`].
    pub(crate) fn definitions(&self) -> Vec<(String, String)> {
        self.engine.definitions().iter_files().collect()
    }

    fn compile(&self, text: &str) -> Result<AST, Box<EvalAltResult>> {
        self.stage.property_names.begin();
        let compiled = catch_unwind(AssertUnwindSafe(|| self.engine.compile(text)));
        compiled.map_err(|panic| broken(panic.as_ref()))?.map_err(Box::from)
    }

    fn evaluate(&mut self, ast: &AST) -> Result<Dynamic, Problem> {
        let mut scope = std::mem::take(&mut self.scope);
        let run = || {
            self.stage.meter.begin_with(&scope);
            self.engine.eval_ast_with_scope::<Dynamic>(&mut scope, ast)
        };
        let result = self.guarded(self.stage.limits.main, run);
        let constants = scope.iter_raw().filter(|(_, constant, _)| *constant);
        *self.constants.borrow_mut() = constants.map(|(name, _, value)| (name.to_string(), value.flatten_clone())).collect();
        self.scope = scope;
        result.map_err(|error| self.problem(&error))
    }

    /// Calls a function of the script, with as many of the values as it takes. A problem that knows no place of its own
    /// gets that of the handler.
    pub(crate) fn call(&self, handler: &Handler, mut values: Vec<Dynamic>) -> Result<Dynamic, Problem> {
        self.stage.write(|graph| self.stage.set_origin(graph, handler.place));
        values.truncate(self.parameters(&handler.call).unwrap_or(values.len()));
        let call = || handler.call.call::<Dynamic>(&self.engine, &self.ast, values);
        self.guarded(self.stage.limits.handler, call).map_err(|error| {
            let mut problem = self.problem(&error);
            if problem.line == 0 {
                (problem.file, problem.line, problem.column) = self.stage.source.borrow().place(handler.place);
            }
            problem
        })
    }

    /// How many values a function takes beside those that it captured; the most, if there are several of its name.
    fn parameters(&self, function: &FnPtr) -> Option<usize> {
        let named = self.ast.iter_functions().filter(|known| known.name == function.fn_name());
        named.map(|known| known.params.len().saturating_sub(function.curry().len())).max()
    }

    /// Runs script code against the clock; a panic of the engine is a problem like any other.
    fn guarded(&self, time: Duration, run: impl FnOnce() -> Outcome<Dynamic>) -> Outcome<Dynamic> {
        let result = catch_unwind(AssertUnwindSafe(|| self.stage.meter.within(time, run)));
        let result = result.unwrap_or_else(|panic| Err(broken(panic.as_ref())));
        match result {
            Err(error) if matches!(*error, EvalAltResult::Exit(..)) => Ok(Dynamic::UNIT),
            result => result,
        }
    }

    fn problem(&self, error: &EvalAltResult) -> Problem {
        problem_from(error, &self.stage.source.borrow(), self)
    }
}

impl Drop for Script {
    fn drop(&mut self) {
        on_deep_stack(|| {
            self.stage.on_frame.borrow_mut().clear();
            self.stage.on_change.borrow_mut().clear();
            self.stage.awaited.borrow_mut().clear();
            self.stage.definitions.borrow_mut().clear();
            self.stage.compiled.borrow_mut().clear();
            self.stage.running_constants.borrow_mut().clear();
            self.constants.borrow_mut().clear();
            self.scope.clear();
        });
    }
}

fn broken(panic: &(dyn std::any::Any + Send)) -> Box<EvalAltResult> {
    let text = panic.downcast_ref::<String>().map(String::as_str).or(panic.downcast_ref::<&str>().copied());
    Fault::new(format!("the script engine gave up: {}", text.unwrap_or("no reason known"))).into()
}

/// Reports a problem of a script that goes on.
pub(crate) fn report(stage: &Stage, fault: Fault, position: Position) {
    let (file, line, column) = stage.source.borrow().place(position);
    let problem = Problem { message: fault.message, file, line, column, node: fault.node, field: fault.field, calls: Vec::new() };
    stage.problems.borrow_mut().push(problem);
}

/// Everything but sleeping, clocks and raw bytes.
fn take_packages(engine: &mut Engine) {
    engine
        .register_global_module(ArithmeticPackage::new().as_shared_module())
        .register_global_module(BasicStringPackage::new().as_shared_module())
        .register_global_module(BasicIteratorPackage::new().as_shared_module())
        .register_global_module(BasicFnPackage::new().as_shared_module())
        .register_global_module(LogicPackage::new().as_shared_module())
        .register_global_module(BasicMathPackage::new().as_shared_module())
        .register_global_module(BasicArrayPackage::new().as_shared_module())
        .register_global_module(BasicMapPackage::new().as_shared_module())
        .register_global_module(MoreStringPackage::new().as_shared_module());
    engine.disable_symbol("eval").disable_symbol("import").disable_symbol("export");
}

fn set_limits(engine: &mut Engine, limits: &Limits) {
    engine
        .set_max_call_levels(limits.call_depth)
        .set_max_expr_depths(256, 128)
        .set_max_variables(4096)
        .set_max_functions(4096)
        .set_max_modules(0)
        .set_max_array_size(limits.array_len)
        .set_max_map_size(limits.map_len)
        .set_max_string_size(limits.string_len)
        .set_max_strings_interned(1024);
}

fn set_hooks(engine: &mut Engine, stage: &Rc<Stage>, constants: &Constants) {
    let names = stage.clone();
    engine.on_print(|text| tracing::info!(target: "umbriel::script", "{text}"));
    engine.on_debug(|text, _, position| tracing::debug!(target: "umbriel::script", "{position:?}: {text}"));
    let clock = stage.clone();
    engine.on_progress(move |_| clock.meter.tick().map(Dynamic::from));
    let (stage, constants) = (stage.clone(), constants.clone());
    // rhai marks these two as likely to change between its versions, which it does with its word "deprecated".
    #[allow(deprecated)]
    engine.on_parse_token(move |token, _, _| names.property_names.map(token));
    #[allow(deprecated)]
    engine.on_var(move |name, index, context| {
        if let Some(reason) = stage.meter.weigh(context.call_level(), context.scope()) {
            return Err(EvalAltResult::ErrorTerminated(reason.into(), Position::NONE).into());
        }
        // A place in the scope that the parser knows; names without one may be constants of the main script.
        if index != 0 || context.scope().contains(name) {
            return Ok(None);
        }
        // The inputs of an Expression are fields, which any spelling names.
        if let Some(input) = context.scope().get(&canonical(name)).filter(|_| stage.is_alone()) {
            return Ok(Some(input.clone()));
        }
        let running = context.global_runtime_state().constants.as_ref().and_then(|c| c.borrow().get(name).cloned());
        let running = running.or_else(|| stage.running_constants.borrow().get(name).cloned());
        Ok(running.or_else(|| constants.borrow().get(name).cloned()))
    });
}

/// What a `catch` gets: `error.message`, `error.node`, `error.field`.
fn name_faults(engine: &mut Engine) {
    let text = |text: &Option<String>| text.clone().map_or(Dynamic::UNIT, Dynamic::from);
    engine
        .register_type_with_name::<Fault>("Fault")
        .register_get("message", |fault: &mut Fault| fault.message.clone())
        .register_get("node", move |fault: &mut Fault| text(&fault.node))
        .register_get("field", move |fault: &mut Fault| text(&fault.field))
        .register_fn("to_string", |fault: &mut Fault| fault.message.clone())
        .register_fn("to_debug", |fault: &mut Fault| fault.message.clone());
}

fn set_constants(engine: &mut Engine, world: Option<Node>) {
    let mut module = Module::new();
    if let Some(world) = world {
        module.set_var("world", world);
    }
    module.set_var("PI", std::f64::consts::PI);
    module.set_var("TAU", std::f64::consts::TAU);
    engine.register_global_module(module.into());
}

impl Known for Script {
    fn no_function(&self, signature: &str) -> String {
        let (name, types) = signature.split_once(" (").unwrap_or((signature, ""));
        let types = types.trim_end_matches(')').replace("&str | ImmutableString | String", "string");
        let types = types.replace("i64", "int").replace("f64", "number");
        if !name.starts_with(|c: char| c.is_alphabetic() || c == '_') {
            return format!("`{name}` does not work with {}", types.replace(", ", " and "));
        }
        let forms: Vec<&str> = self.docs.iter().filter(|doc| doc.name() == name).map(|doc| doc.signature).collect();
        let own: Vec<String> = self.ast.iter_functions().filter(|f| f.name == name).map(|f| f.to_string()).collect();
        if let Some((_, parameters)) = own.first().filter(|_| name.starts_with("anon$")).and_then(|own| own.split_once('(')) {
            return format!("a closure of |{}| does not take ({types})", parameters.trim_end_matches(')'));
        }
        if !forms.is_empty() || !own.is_empty() {
            let forms: Vec<&str> = forms.into_iter().chain(own.iter().map(String::as_str)).collect();
            return format!("`{name}` does not take ({types}); there is {}", forms.join(" and "));
        }
        let functions: Vec<String> = self.ast.iter_functions().map(|f| f.name.to_string()).collect();
        let known = self.docs.iter().map(|doc| doc.name()).chain(functions.iter().map(String::as_str));
        format!("there is no function `{name}`{}", hint(name, known))
    }

    fn endless_loop(&self) -> Position {
        let mut place = Position::NONE;
        self.ast.walk(&mut |nodes: &[ASTNode<'_>]| match nodes.last() {
            Some(ASTNode::Stmt(Stmt::While(parts, position)))
                if parts.body.is_empty() && matches!(parts.expr, Expr::Unit(..) | Expr::BoolConstant(true, ..)) =>
            {
                place = *position;
                false
            }
            _ => true,
        });
        place
    }

    fn no_variable(&self, name: &str) -> String {
        let constants = self.constants.borrow();
        let variables = self.scope.iter_raw().map(|(name, _, _)| name).chain(constants.keys().map(String::as_str));
        let hint = hint(name, variables.chain(["world", "PI", "TAU"]));
        let advice =
            if hint.is_empty() { "; functions see what they are given and the constants of the main script" } else { "" };
        format!("there is no variable `{name}`{hint}{advice}")
    }
}
