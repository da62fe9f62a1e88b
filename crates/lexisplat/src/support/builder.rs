//! Builder methods of option structs.

/// Defines public methods `$with(value)`, each of which sets the field `$field`. `value` is converted to the type of the
/// field, so that a field that is an `Option` takes a plain value.
macro_rules! builder_methods {
    ($($with:ident($field:ident: $type:ty)),* $(,)?) => {$(
        #[doc = concat!("Sets [`Self::", stringify!($field), "`].")]
        #[must_use]
        pub fn $with(mut self, $field: $type) -> Self {
            self.$field = $field.into();
            self
        }
    )*};
}
pub(crate) use builder_methods;
