//! The node types that a graph can create, by name.

use std::collections::HashMap;
use std::sync::{Arc, PoisonError, RwLock, RwLockReadGuard};

use crate::naming::{canonical, hint};
use crate::{Error, NodeType};

/// All known node types. Cheap to clone: clones share the types.
#[derive(Clone, Debug, Default)]
pub struct TypeRegistry {
    known: Arc<RwLock<Known>>,
}

#[derive(Debug, Default)]
struct Known {
    types: Vec<Arc<NodeType>>,
    /// Canonical names and aliases.
    index: HashMap<String, usize>,
}

impl TypeRegistry {
    /// No types.
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes a type known. An error if its name or an alias is taken, or if the declaration contradicts itself.
    pub fn register(&self, node_type: NodeType) -> Result<Arc<NodeType>, Error> {
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        let names = checked_names(&node_type)?;
        if let Some((name, other)) = names.iter().find_map(|name| Some((name, *known.index.get(name)?))) {
            let other = known.types[other].name.to_string();
            return Err(Error::DuplicateType { node_type: node_type.name.to_string(), name: name.clone(), other });
        }
        let place = known.types.len();
        let node_type = Arc::new(node_type);
        known.types.push(node_type.clone());
        known.index.extend(names.into_iter().map(|name| (name, place)));
        Ok(node_type)
    }

    /// Makes a type known in place of the one of the same name, if there is one. Nodes that exist keep their old type.
    pub fn replace(&self, node_type: NodeType) -> Result<Arc<NodeType>, Error> {
        let names = checked_names(&node_type)?;
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        let place = known.types.iter().position(|other| canonical(&other.name) == names[0]);
        let Some(place) = place else {
            drop(known);
            return self.register(node_type);
        };
        if let Some((name, other)) =
            names.iter().find_map(|name| known.index.get(name).filter(|at| **at != place).map(|at| (name, *at)))
        {
            let other = known.types[other].name.to_string();
            return Err(Error::DuplicateType { node_type: node_type.name.to_string(), name: name.clone(), other });
        }
        let node_type = Arc::new(node_type);
        known.types[place] = node_type.clone();
        known.index.retain(|_, at| *at != place);
        known.index.extend(names.into_iter().map(|name| (name, place)));
        Ok(node_type)
    }

    /// A type by its name or alias, in any spelling; the error names the nearest known one.
    pub fn get(&self, name: &str) -> Result<Arc<NodeType>, Error> {
        let known = self.read();
        match known.index.get(&canonical(name)) {
            Some(place) => Ok(known.types[*place].clone()),
            None => {
                let names =
                    known.types.iter().flat_map(|known| std::iter::once(&*known.name).chain(known.aliases.iter().map(|a| &**a)));
                Err(Error::UnknownType { name: name.into(), hint: hint(name, names) })
            }
        }
    }

    /// All types, in the order in which they were registered.
    pub fn iter(&self) -> impl Iterator<Item = Arc<NodeType>> + use<> {
        self.read().types.clone().into_iter()
    }

    fn read(&self) -> RwLockReadGuard<'_, Known> {
        self.known.read().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The canonical name and aliases of a type without fault.
fn checked_names(node_type: &NodeType) -> Result<Vec<String>, Error> {
    if let Some(fault) = node_type.fault() {
        return Err(Error::BadType { node_type: node_type.name.to_string(), fault });
    }
    let mut names = vec![canonical(&node_type.name)];
    for alias in &node_type.aliases {
        let alias = canonical(alias);
        if !names.contains(&alias) {
            names.push(alias);
        }
    }
    Ok(names)
}

impl From<Vec<NodeType>> for TypeRegistry {
    /// Registers all; a type that cannot be is left out with an error in the log.
    fn from(types: Vec<NodeType>) -> Self {
        let registry = Self::new();
        for node_type in types {
            if let Err(error) = registry.register(node_type) {
                tracing::error!("{error}");
            }
        }
        registry
    }
}
