//! Property names of the INRIA layout (`scene/gaussian_model.py`, `construct_list_of_attributes`).

/// Names of positions.
pub(super) const POSITION: [&str; 3] = ["x", "y", "z"];
/// Names of normals. They are zeros in the files of all trainers.
pub(super) const NORMAL: [&str; 3] = ["nx", "ny", "nz"];
/// Names of SH coefficient 0.
pub(super) const DC: [&str; 3] = ["f_dc_0", "f_dc_1", "f_dc_2"];
/// Prefix of the names of SH-rest coefficients, before the number.
pub(super) const REST_PREFIX: &str = "f_rest_";
/// Name of the opacity before the sigmoid.
pub(super) const OPACITY: [&str; 1] = ["opacity"];
/// Names of the logarithms of scales.
pub(super) const SCALE: [&str; 3] = ["scale_0", "scale_1", "scale_2"];
/// Names of the quaternion, w first.
pub(super) const ROTATION: [&str; 4] = ["rot_0", "rot_1", "rot_2", "rot_3"];
/// Name of the element that holds Gaussians.
pub(super) const VERTEX: &str = "vertex";

/// Returns whether a property that 3DGS does not define can have this name. A name with a line break could add lines to a
/// header. It can have the name of a normal, since a scene need not have normals.
pub(crate) fn is_extra_name(name: &str) -> bool {
    let fixed = [&POSITION[..], &DC, &OPACITY, &SCALE, &ROTATION].concat();
    let digits = name.strip_prefix(REST_PREFIX).filter(|digits| !digits.is_empty());
    let is_rest = digits.is_some_and(|digits| digits.bytes().all(|digit| digit.is_ascii_digit()));
    let is_token = !name.is_empty() && !name.chars().any(|c| c.is_whitespace() || c.is_control());
    is_token && !fixed.contains(&name) && !is_rest
}

/// Largest number of characters of a name or token from a file in a message.
const SHOWN: usize = 48;

/// Returns a name or token from a file for a message of one line: shortened, with escaped control characters.
pub(super) fn shown(text: &str) -> String {
    let mut out: String = text.chars().take(SHOWN).flat_map(char::escape_debug).collect();
    if text.chars().nth(SHOWN).is_some() {
        out.push_str("...");
    }
    out
}

/// Returns the first few of `names` and the number of the others, for a message.
pub(super) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    /// Number of names before "and n more".
    const SPELT: usize = 6;
    let mut text = names.iter().take(SPELT).map(|n| shown(n.as_ref())).collect::<Vec<_>>().join(", ");
    if names.len() > SPELT {
        text.push_str(&format!(" and {} more", names.len() - SPELT));
    }
    text
}
