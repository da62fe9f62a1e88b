//! Reads JSON step by step, so that errors name the object and the field, and a list that is too long is refused while it
//! is read.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{
    Deserialize, DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor,
};

use crate::error::Result;
use crate::view_files::MAX_CAMERAS_BYTES;

/// Returns the value that `seed` reads from `bytes`, which must hold nothing else.
pub(crate) fn parse<'de, S: DeserializeSeed<'de>>(bytes: &'de [u8], seed: S) -> Result<S::Value, String> {
    if u64::try_from(bytes.len()).is_ok_and(|len| len > MAX_CAMERAS_BYTES) {
        return Err(format!("over the limit of {MAX_CAMERAS_BYTES} bytes"));
    }
    let mut json = serde_json::Deserializer::from_slice(bytes);
    let value = seed.deserialize(&mut json).map_err(|e| e.to_string())?;
    json.end().map_err(|e| e.to_string())?;
    Ok(value)
}

/// The fields of an object. They come in any order. Of two fields with the same name the later one counts.
pub(crate) trait Fields: Default {
    /// The value that the object represents.
    type Value;

    /// Reads the value of `key` if it is a known field. Returns whether it is.
    fn read<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<bool, A::Error>;

    /// Returns the value. Errors begin with `about`.
    fn finish(self, about: &str) -> Result<Self::Value, String>;
}

/// Reads a value to `slot`. Returns `true`, for implementations of [`Fields::read`].
pub(crate) fn set<'de, A: MapAccess<'de>, T: Deserialize<'de>>(
    slot: &mut T,
    map: &mut A,
) -> Result<bool, A::Error> {
    *slot = map.next_value()?;
    Ok(true)
}

/// Returns the value of a required field.
pub(crate) fn required<T>(value: Option<T>, field: &str, about: &str) -> Result<T, String> {
    value.ok_or_else(|| format!("{about}field '{field}' is missing"))
}

/// Reads an object.
pub(crate) struct Object<T> {
    /// The beginning of errors about the object.
    pub(crate) about: String,
    pub(crate) expected: String,
    pub(crate) fields: T,
}

impl<T: Fields> Object<T> {
    /// Returns the object at position `index` of a list of objects that are called `name`.
    pub(crate) fn element(name: &str, index: usize) -> Self {
        let about = format!("{name} {index}: ");
        Self { about, expected: format!("{name} {index} as an object"), fields: T::default() }
    }
}

impl<'de, T: Fields> DeserializeSeed<'de> for Object<T> {
    type Value = T::Value;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<T::Value, D::Error> {
        json.deserialize_map(self)
    }
}

impl<'de, T: Fields> Visitor<'de> for Object<T> {
    type Value = T::Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.expected)
    }

    fn visit_map<A: MapAccess<'de>>(mut self, mut map: A) -> Result<T::Value, A::Error> {
        while let Some(key) = map.next_key::<String>()? {
            let read = match self.fields.read(&key, &mut map) {
                Ok(false) => map.next_value::<IgnoredAny>().map(|_| ()),
                known => known.map(|_| ()),
            };
            read.map_err(|e| A::Error::custom(format!("{}field '{key}': {e}", self.about)))?;
        }
        self.fields.finish(&self.about).map_err(A::Error::custom)
    }
}

/// Reads a list of at most `most` of `what`. `element` makes the seed of the element at each position.
pub(crate) struct List<F> {
    pub(crate) expected: String,
    pub(crate) most: usize,
    pub(crate) what: &'static str,
    pub(crate) element: F,
}

impl<'de, S: DeserializeSeed<'de>, F: Fn(usize) -> S> DeserializeSeed<'de> for List<F> {
    type Value = Vec<S::Value>;

    fn deserialize<D: Deserializer<'de>>(self, json: D) -> Result<Self::Value, D::Error> {
        json.deserialize_seq(self)
    }
}

impl<'de, S: DeserializeSeed<'de>, F: Fn(usize) -> S> Visitor<'de> for List<F> {
    type Value = Vec<S::Value>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.expected)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = list.next_element_seed((self.element)(values.len()))? {
            if values.len() == self.most {
                return Err(A::Error::custom(format!("over the limit of {} {}", self.most, self.what)));
            }
            values.push(value);
        }
        Ok(values)
    }
}

/// A list of at most `N` values.
#[derive(Debug, Default)]
pub(crate) struct Short<T, const N: usize>(pub(crate) Vec<T>);

impl<'de, T: Deserialize<'de>, const N: usize> Deserialize<'de> for Short<T, N> {
    fn deserialize<D: Deserializer<'de>>(json: D) -> Result<Self, D::Error> {
        let expected = format!("a list of at most {N}");
        List { expected, most: N, what: "entries", element: |_| PhantomData::<T> }.deserialize(json).map(Self)
    }
}
