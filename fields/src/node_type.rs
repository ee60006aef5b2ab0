//! The declaration of a node type, which code, scripts, importers, files and the inspector share.

use std::collections::HashMap;
use std::fmt;
use std::sync::Arc;

use crate::Field;
use crate::evaluation::Evaluation;
use crate::naming::canonical;

/// When a node is evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// In each frame in which one of its fields was written.
    #[default]
    OnChange,
    /// In every frame.
    Always,
    /// Only when asked for, by `Graph::pull` or as the second node of `Graph::depend_for_this_frame`.
    Pull,
}

/// What evaluates a node.
#[derive(Clone, Default)]
pub enum Evaluator {
    /// Nothing; the node only holds values.
    #[default]
    None,
    /// A function that sees nothing but the node's own fields.
    Native(Arc<dyn Fn(&mut Evaluation<'_>) + Send + Sync>),
    /// The host, which may do anything to the graph; for script types.
    Host,
}

impl fmt::Debug for Evaluator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Evaluator::None => "None",
            Evaluator::Native(_) => "Native",
            Evaluator::Host => "Host",
        })
    }
}

/// A node type: name, doc, fields, and what evaluates it.
#[derive(Clone, Debug)]
pub struct NodeType {
    /// `CamelCase`, as authors write it.
    pub name: Arc<str>,
    /// What it is, in a sentence or two.
    pub doc: Arc<str>,
    /// Other names, as other systems write them.
    pub aliases: Vec<Arc<str>>,
    /// The fields; a field's place is the index in its `FieldId`.
    pub fields: Vec<Field>,
    /// What evaluates it.
    pub evaluator: Evaluator,
    /// When it is evaluated.
    pub mode: Mode,
    /// Nodes of this type stay in this process: replicas never learn of them.
    pub local: bool,
    /// Canonical names and aliases of the fields.
    index: HashMap<Arc<str>, u16>,
    /// Names that two fields share; registration refuses them.
    clashes: Vec<Arc<str>>,
}

impl NodeType {
    /// A type without fields.
    pub fn new(name: impl Into<Arc<str>>, doc: impl Into<Arc<str>>) -> Self {
        Self {
            name: name.into(),
            doc: doc.into(),
            aliases: Vec::new(),
            fields: Vec::new(),
            evaluator: Evaluator::None,
            mode: Mode::OnChange,
            local: false,
            index: HashMap::new(),
            clashes: Vec::new(),
        }
    }

    /// Another name of the type, as another system writes it.
    pub fn alias(mut self, alias: impl Into<Arc<str>>) -> Self {
        self.aliases.push(alias.into());
        self
    }

    /// Adds a field.
    pub fn field(mut self, field: Field) -> Self {
        let place = self.fields.len() as u16;
        for name in std::iter::once(&field.name).chain(&field.aliases) {
            if self.index.insert(name.clone(), place).is_some_and(|other| other != place) {
                self.clashes.push(name.clone());
            }
        }
        self.fields.push(field);
        self
    }

    /// Adds fields.
    pub fn fields(self, fields: impl IntoIterator<Item = Field>) -> Self {
        fields.into_iter().fold(self, NodeType::field)
    }

    /// Evaluated by a function that sees nothing but the node's own fields.
    pub fn evaluate(mut self, evaluate: impl Fn(&mut Evaluation<'_>) + Send + Sync + 'static) -> Self {
        self.evaluator = Evaluator::Native(Arc::new(evaluate));
        self
    }

    /// Evaluated by the host; see [`crate::Host::evaluate`].
    pub fn host_evaluated(mut self) -> Self {
        self.evaluator = Evaluator::Host;
        self
    }

    /// Evaluated in every frame, changed or not.
    pub fn always_evaluate(mut self) -> Self {
        self.mode = Mode::Always;
        self
    }

    /// Evaluated only when asked for.
    pub fn pull_only(mut self) -> Self {
        self.mode = Mode::Pull;
        self
    }

    /// Keeps its nodes from replicas.
    pub fn local(mut self) -> Self {
        self.local = true;
        self
    }

    /// The place of a field by its name or alias, in any spelling.
    pub fn field_index(&self, name: &str) -> Option<u16> {
        self.index.get(name).or_else(|| self.index.get(canonical(name).as_str())).copied()
    }

    /// A declared field by its name or alias, in any spelling.
    pub fn field_named(&self, name: &str) -> Option<&Field> {
        self.fields.get(self.field_index(name)? as usize)
    }

    /// What is wrong with the declaration.
    pub(crate) fn fault(&self) -> Option<String> {
        if canonical(&self.name).is_empty() {
            return Some("it has no name".into());
        }
        if let Some(name) = self.clashes.first() {
            return Some(format!("two fields are called `{name}`"));
        }
        if self.fields.len() > u16::MAX as usize {
            return Some(format!("it has more than {} fields", u16::MAX));
        }
        self.fields.iter().find_map(Field::fault)
    }
}
