//! Names of set-up parameters, which are the numbers that `sym` records while plants, laws and arms are built. A label is the name of a
//! scope and an index in this scope.

/// A name with an index. A parameter without a label has an empty name. A label without an index has index 0.
pub type Label = (&'static str, u32);

/// The labels of all set-up parameters, and the label of the next parameter.
#[derive(Default)]
pub(super) struct Labels {
    pub all: Vec<Label>,
    scope: Label,
}

impl Labels {
    /// Label the next parameters with `name` and indices from `first` on. Return the previous label, for [`Labels::end`].
    pub fn begin(&mut self, name: &'static str, first: u32) -> Label {
        std::mem::replace(&mut self.scope, (name, first))
    }

    /// Restore the previous label.
    pub fn end(&mut self, before: Label) {
        self.scope = before;
    }

    /// Return the label of the next set-up parameter.
    pub fn next(&mut self) -> Label {
        let label = self.scope;
        self.scope.1 += 1;
        label
    }
}
