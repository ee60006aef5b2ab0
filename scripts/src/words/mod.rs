//! The words of the language: every function that worlds can call, with its documentation.

pub(crate) mod declare;
mod explain;
mod handlers;
mod lists;
mod maths;
mod models;
mod nodes;
mod paper;
mod rigs;
mod routes;
mod shapes;
mod sharing;
mod types;
mod vectors;

pub(crate) use nodes::set;

use std::rc::Rc;

use rhai::{Engine, FuncRegistration, RhaiNativeFunc, Variant};

use crate::reference::FunctionDoc;
use crate::stage::Stage;

/// Collects functions into an engine, and their documentation beside it.
pub(crate) struct Words<'a> {
    pub(crate) engine: &'a mut Engine,
    pub(crate) stage: Rc<Stage>,
    pub(crate) docs: Vec<FunctionDoc>,
    chapter: &'static str,
}

impl Words<'_> {
    fn chapter(&mut self, chapter: &'static str) -> &mut Self {
        self.chapter = chapter;
        self
    }

    /// A function; the signature reads `name(parameter: type, ...) -> type`.
    fn word<A: 'static, const N: usize, const X: bool, R: Variant + Clone, const F: bool>(
        &mut self,
        signature: &'static str,
        doc: &'static str,
        function: impl RhaiNativeFunc<A, N, X, R, F> + 'static,
    ) -> &mut Self {
        let known = FunctionDoc { chapter: self.chapter, signature, doc };
        self.docs.push(known);
        FuncRegistration::new(known.name())
            .with_volatility(true)
            .with_purity(true)
            .with_params_info(known.parameters())
            .with_comments([format!("/// {doc}")])
            .register_into_engine(self.engine, function);
        self
    }

    /// Another form of a function that is documented already; only the name of the signature matters. Constants may be
    /// given too: a node that is held by a constant can change.
    fn form<A: 'static, const N: usize, const X: bool, R: Variant + Clone, const F: bool>(
        &mut self,
        signature: &'static str,
        function: impl RhaiNativeFunc<A, N, X, R, F> + 'static,
    ) -> &mut Self {
        let name = signature.split('(').next().unwrap_or(signature);
        FuncRegistration::new(name).with_volatility(true).with_purity(true).register_into_engine(self.engine, function);
        self
    }
}

/// Teaches an engine every word.
pub(crate) fn teach(engine: &mut Engine, stage: &Rc<Stage>) -> Vec<FunctionDoc> {
    let mut words = Words { engine, stage: stage.clone(), docs: Vec::new(), chapter: "" };
    nodes::teach(words.chapter("Nodes and fields"));
    routes::teach(words.chapter("Routes"));
    handlers::teach(words.chapter("Handlers"));
    explain::teach(words.chapter("Explanations"));
    shapes::teach(words.chapter("Shapes and groups"));
    sharing::teach(words.chapter("Worlds of several applications"));
    models::teach(words.chapter("Models"));
    types::teach(words.chapter("Node types of your own"));
    declare::teach(&mut words);
    vectors::teach(words.chapter("Vectors, turns, colours"));
    maths::teach(words.chapter("Numbers"));
    lists::teach(words.chapter("Lists"));
    rigs::teach(words.chapter("Rooms"));
    paper::teach(words.chapter("As in AVANGO's scheme"));
    words.docs
}
