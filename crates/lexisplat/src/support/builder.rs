//! Builder methods of option structs.

/// Defines public methods `$with(value)`, each of which sets the field `$field`.
macro_rules! builder_methods {
    ($($with:ident($field:ident: $type:ty)),* $(,)?) => {$(
        #[doc = concat!("Sets [`Self::", stringify!($field), "`].")]
        #[must_use]
        pub fn $with(mut self, $field: $type) -> Self {
            self.$field = $field;
            self
        }
    )*};
}
pub(crate) use builder_methods;
