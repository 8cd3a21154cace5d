//! Models: what a page shows, and runs.

use std::borrow::Cow;

use filippov::action::Actions;
use filippov::{Laws, PiecewiseSystem, ReadySystem, RunnableSystem, SavedSystem};
use filippov_expr::container::Tag;
use filippov_expr::Backend;
use serde_json::{Map, Value};

use crate::refusal::Refusal;
use crate::request::Request;
use crate::run_request::start_of;

/// The section that a page adds to the bytes of a system.
const PAGE: Tag = Tag(*b"PAGE");

/// A parameter and its default value.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its default value.
    pub value: f64,
}

/// What a page knows of a system before it runs.
#[derive(Clone, Debug, Default)]
pub struct Description {
    /// Names of the states.
    pub states: Vec<String>,
    /// Parameters.
    pub params: Vec<Parameter>,
    /// The printed switching functions that a user sees, the first ones of the system.
    pub surfaces: Vec<String>,
    /// Names of the actions.
    pub actions: Vec<String>,
    /// Names of the discrete states that actions set.
    pub discrete: Vec<String>,
    /// Is it valid for the default values of the parameters alone?
    pub is_pinned: bool,
    /// The section of the page: title, start, span, ranges of sliders.
    pub page: Map<String, Value>,
}

impl Description {
    /// Takes over the section of a page.
    ///
    /// # Errors
    /// If the text is no JSON object.
    pub fn set_page(&mut self, text: &str) -> Result<(), Refusal> {
        self.page = page_of(text)?;
        Ok(())
    }
}

/// What runs: a system for values of the parameters, and a start.
pub trait Source: Send + Sync {
    /// The system with these parameter values, with its actions and its discrete states at a start at (t, x).
    ///
    /// # Errors
    /// If there is none.
    fn ready(&self, params: &[f64], t: f64, x: &[f64]) -> Result<Box<dyn Ready + '_>, Refusal>;

    /// The discrete states at a start at (t, x) where another run left these; `None` if they are not known, as at any start.
    ///
    /// # Errors
    /// If a function of the model fails.
    fn going_on(
        &self,
        _params: &[f64],
        _at: (f64, &[f64]),
        _before: &[f64],
    ) -> Result<Option<Vec<f64>>, Refusal> {
        Ok(None)
    }
}

/// A system that is ready for a run.
pub trait Ready {
    /// The system.
    fn system(&self) -> &dyn PiecewiseSystem;

    /// What changes the state in instants, and the discrete states.
    fn actions(&self) -> Actions<'_>;
}

/// A system that was compiled, and its laws.
struct Compiled {
    system: RunnableSystem,
    laws: Laws,
}

impl Source for Compiled {
    fn ready(&self, params: &[f64], t: f64, x: &[f64]) -> Result<Box<dyn Ready + '_>, Refusal> {
        Ok(Box::new(self.system.at(params, t, x)?))
    }

    fn going_on(
        &self,
        params: &[f64],
        at: (f64, &[f64]),
        before: &[f64],
    ) -> Result<Option<Vec<f64>>, Refusal> {
        let system = self.system.system().with_parameters(params.to_vec());
        Ok(Some(self.laws.go_on(&system, at, before)?))
    }
}

impl Ready for ReadySystem<'_> {
    fn system(&self) -> &dyn PiecewiseSystem {
        ReadySystem::system(self)
    }

    fn actions(&self) -> Actions<'_> {
        ReadySystem::actions(self)
    }
}

/// A system with what a page knows of it.
pub struct Model {
    pub(crate) description: Description,
    source: Box<dyn Source>,
}

impl Model {
    /// The model of a source.
    ///
    /// # Errors
    /// If the description has no states, or its page is that of another model.
    pub fn new(description: Description, source: Box<dyn Source>) -> Result<Self, Refusal> {
        if description.states.is_empty() {
            return Err(Refusal::model("a model needs a state"));
        }
        let model = Model {
            description,
            source,
        };
        check_page(&model)?;
        Ok(model)
    }

    /// The model in the bytes of a saved system, with the section of a page or without one.
    ///
    /// # Errors
    /// If the bytes are damaged, hold something else, or the system cannot be compiled.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Refusal> {
        let refused = |error: filippov::Error| Refusal::model(error.to_string());
        let (saved, text) = unpack(bytes).map_err(refused)?;
        let page = text.as_deref().map_or(Ok(Map::new()), page_of)?;
        let definition = &saved.definition;
        let (n, n_parameters) = (definition.field.len(), definition.n_parameters());
        let names = &definition.names;
        let states = match names.states.is_empty() {
            true => (0..n).map(|i| format!("x[{i}]")).collect(),
            false => names.states.clone(),
        };
        let values = saved.valid_for.as_ref().unwrap_or(&saved.defaults);
        let params = names.parameters.iter().zip(values);
        let params = params.map(|(name, &value)| Parameter {
            name: name.clone(),
            value,
        });
        let n_named = definition.n_named();
        let mut description = Description {
            states,
            params: params.collect(),
            surfaces: Vec::new(),
            actions: saved.actions.iter().map(|a| a.name.clone()).collect(),
            discrete: names.parameters[n_parameters..][..n_named].to_vec(),
            is_pinned: saved.valid_for.is_some(),
            page,
        };
        // Read once more: a copy of the definition needs code that nothing else here has.
        let again = unpack(bytes).map_err(refused)?.0.definition;
        let (_, laws) = again.build(Backend::Interpreter).map_err(refused)?;
        let system = saved.build(Backend::Auto).map_err(refused)?;
        let surfaces = 0..system.n_visible();
        description.surfaces = surfaces
            .map(|j| PiecewiseSystem::surface_name(system.system(), j))
            .collect();
        Model::new(description, Box::new(Compiled { system, laws }))
    }

    /// The number of states.
    pub(crate) fn n(&self) -> usize {
        self.description.states.len()
    }

    /// How many surfaces a user sees.
    pub(crate) fn n_visible(&self) -> usize {
        self.description.surfaces.len()
    }

    /// The name of a surface, also of one that a user does not see.
    pub(crate) fn surface(&self, j: usize) -> Cow<'_, str> {
        match self.description.surfaces.get(j) {
            Some(name) => name.into(),
            None => format!("h{j}").into(),
        }
    }

    pub(crate) fn ready(
        &self,
        params: &[f64],
        t: f64,
        x: &[f64],
    ) -> Result<Box<dyn Ready + '_>, Refusal> {
        if x.len() != self.n() {
            let text = format!("y0: {} numbers are needed, there are {}", self.n(), x.len());
            return Err(Refusal::request(text));
        }
        self.source.ready(params, t, x)
    }

    /// Lets a run at (t, x) begin with the discrete states that another one has left.
    ///
    /// # Errors
    /// If a function of the model fails.
    pub(crate) fn go_on(
        &self,
        actions: &mut Actions<'_>,
        params: &[f64],
        at: (f64, &[f64]),
        before: &[f64],
    ) -> Result<(), Refusal> {
        if let Some(found) = self.source.going_on(params, at, before)? {
            actions.discrete = found;
        }
        Ok(())
    }
}

/// The bytes of a model: those of a saved system, with the section of a page.
///
/// # Errors
/// If the bytes are not those of a system, or the section is no JSON object.
pub fn pack(system: &[u8], page: &str) -> Result<Vec<u8>, Refusal> {
    let refused = |error: filippov::Error| Refusal::model(error.to_string());
    page_of(page)?;
    let (saved, _) = unpack(system).map_err(refused)?;
    Ok(saved.to_bytes_with(PAGE, page))
}

/// The system in the bytes of a model, and the text of the section of its page, if it has one.
///
/// # Errors
/// As [`SavedSystem::from_bytes`].
pub fn unpack(model: &[u8]) -> Result<(SavedSystem, Option<String>), filippov::Error> {
    SavedSystem::from_bytes_with(model, PAGE)
}

/// A host draws what the section of a page says before it asks anything: each field has to be one of this model.
fn check_page(model: &Model) -> Result<(), Refusal> {
    let page = Request::page(model);
    start_of(model, &page)?;
    if let Some([from, to]) = page.exactly::<2>("t_span")? {
        if from == to {
            return Err(page.wrong("t_span", "two different times are needed"));
        }
    }
    if let Some(axes) = page.exactly::<2>("axes")? {
        let is_state = |axis: f64| (0..model.n()).any(|i| i as f64 == axis);
        if !axes.into_iter().all(is_state) || axes[0] == axes[1] {
            let last = model.n() - 1;
            let requirement = format!("two different states are needed, from 0 to {last}");
            return Err(page.wrong("axes", &requirement));
        }
    }
    if let Some(ranges) = page.object("ranges")? {
        for (name, _) in ranges.entries() {
            ranges.exactly::<2>(name)?;
        }
    }
    page.number("rtol")?;
    for name in ["title", "method", "text", "reference"] {
        page.text(name)?;
    }
    Ok(())
}

fn page_of(text: &str) -> Result<Map<String, Value>, Refusal> {
    match serde_json::from_str(text) {
        Ok(Value::Object(page)) => Ok(page),
        Ok(_) => Err(Refusal::model("the section PAGE is no JSON object")),
        Err(error) => Err(Refusal::model(format!("the section PAGE: {error}"))),
    }
}
