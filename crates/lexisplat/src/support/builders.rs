//! Builder methods of option structs.

/// Makes a method for each field that returns the options with another value of it.
macro_rules! builders {
    ($options:ident { $($(#[$doc:meta])* $method:ident: $field:ident: $type:ty),+ $(,)? }) => {
        impl $options {
            $($(#[$doc])*
            #[must_use]
            pub fn $method(mut self, $field: $type) -> Self {
                self.$field = $field.into();
                self
            })+
        }
    };
}
pub(crate) use builders;
