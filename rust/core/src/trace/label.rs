//! Names of the numbers of a set-up: the name of a scope, and the index in it.

/// A name with its number. Without a label the name is empty. Without an index the number is 0.
pub type Label = (&'static str, u32);

/// The labels of all inputs of a set-up, and the next one.
#[derive(Default)]
pub(super) struct Labels {
    pub all: Vec<Label>,
    scope: Label,
}

impl Labels {
    /// Name the next numbers `name`, with indices from `first` on. The result is the previous label.
    pub fn begin(&mut self, name: &'static str, first: u32) -> Label {
        std::mem::replace(&mut self.scope, (name, first))
    }

    /// Restore the previous label.
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
