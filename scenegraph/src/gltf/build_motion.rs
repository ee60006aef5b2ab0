//! Animations of a model: a clock each, and an interpolator per channel, wired by routes.

use super::build::{Builder, refused};
use super::error::Fault;
use super::tracks::{Track, Values};
use umbriel_fields::{NodeId, Strength, Time, Value};

impl Builder<'_> {
    /// Makes all animations and adds their nodes to `below`; the first one plays. Returns the clocks.
    pub(super) fn make_animations(&mut self, model: &str, below: &mut Vec<NodeId>) -> Result<Vec<NodeId>, Fault> {
        let content = self.content;
        let mut clocks = Vec::new();
        for (i, animation) in content.animations.iter().enumerate() {
            let name = animation.name.clone().unwrap_or_else(|| i.to_string());
            let clock = self.create("TimeSensor", Some(&format!("{model}/{name}")))?;
            // First of all, so that the others never move anything.
            self.set(clock, "enabled", i == 0)?;
            self.set(clock, "loop", true)?;
            self.set(clock, "cycle_interval", Time(animation.duration_s.into()))?;
            below.push(clock);
            for track in &animation.tracks {
                let interpolator = self.make_interpolator(track)?;
                self.connect((clock, "fraction_changed"), (interpolator, "set_fraction"))?;
                for (node, field) in self.targets(track) {
                    self.connect((interpolator, "value_changed"), (node, field))?;
                }
                below.push(interpolator);
            }
            clocks.push(clock);
        }
        Ok(clocks)
    }

    fn make_interpolator(&mut self, track: &Track) -> Result<NodeId, Fault> {
        let (kind, values) = match &track.values {
            Values::Translation(v) | Values::Scale(v) => ("PositionInterpolator", Value::from(v.clone())),
            Values::Rotation(v) => ("OrientationInterpolator", Value::from(v.clone())),
            Values::Weights(v) => ("ScalarArrayInterpolator", Value::from(v.clone())),
        };
        let node = self.create(kind, None)?;
        self.set(node, "interpolation", track.interpolation)?;
        self.set(node, "key", track.keys.clone())?;
        self.set(node, "key_value", values)?;
        Ok(node)
    }

    /// The fields that a track moves.
    fn targets(&self, track: &Track) -> Vec<(NodeId, &'static str)> {
        let transform = self.transforms[track.node];
        match track.values {
            Values::Translation(_) => vec![(transform, "translation")],
            Values::Rotation(_) => vec![(transform, "rotation")],
            Values::Scale(_) => vec![(transform, "scale")],
            Values::Weights(_) => self.shapes[track.node].iter().map(|s| (*s, "morph_weights")).collect(),
        }
    }

    fn connect(&mut self, from: (NodeId, &str), to: (NodeId, &str)) -> Result<(), Fault> {
        let from_field = self.graph.field(from.0, from.1).map_err(|e| refused(from.1, &e))?;
        let to_field = self.graph.field(to.0, to.1).map_err(|e| refused(to.1, &e))?;
        self.graph.connect(from_field, to_field, Strength::Strong).map_err(|e| refused(to.1, &e))?;
        Ok(())
    }
}
