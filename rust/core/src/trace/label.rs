//! Names of the numbers of a set-up: the name of a scope and the place in it.

/// A name with its number. Both may be missing: a name without a label, and a number 0.
pub type Label = (&'static str, u32);

/// The labels of all inputs of a set-up, and the next one.
#[derive(Default)]
pub(super) struct Labels {
    pub all: Vec<Label>,
    scope: Label,
}

impl Labels {
    /// Name the following numbers `name`, with indices from `first` on. The result is the label before.
    pub fn begin(&mut self, name: &'static str, first: u32) -> Label {
        std::mem::replace(&mut self.scope, (name, first))
    }

    /// Restore the label from before.
    pub fn end(&mut self, before: Label) {
        self.scope = before;
    }

    /// The label of the next number of the set-up.
    pub fn next(&mut self) -> Label {
        let label = self.scope;
        self.scope.1 += 1;
        label
    }
}
