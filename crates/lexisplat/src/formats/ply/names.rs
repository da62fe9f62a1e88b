//! Property names of the INRIA layout (`scene/gaussian_model.py`, `construct_list_of_attributes`).

/// Centres.
pub(super) const POSITION: [&str; 3] = ["x", "y", "z"];
/// Normals, zeros in every trainer's file.
pub(super) const NORMAL: [&str; 3] = ["nx", "ny", "nz"];
/// SH coefficient 0.
pub(super) const DC: [&str; 3] = ["f_dc_0", "f_dc_1", "f_dc_2"];
/// Prefix of an SH-rest coefficient's number.
pub(super) const REST_PREFIX: &str = "f_rest_";
/// Opacity before the sigmoid.
pub(super) const OPACITY: [&str; 1] = ["opacity"];
/// Logarithmic scales.
pub(super) const SCALE: [&str; 3] = ["scale_0", "scale_1", "scale_2"];
/// Quaternion, w first.
pub(super) const ROTATION: [&str; 4] = ["rot_0", "rot_1", "rot_2", "rot_3"];
/// The element that holds Gaussians.
pub(super) const VERTEX: &str = "vertex";

/// Whether a property that 3DGS does not define can have this name. A name with a line break could add lines to a header.
/// The names of normals are such names, since a scene need not have normals.
pub(crate) fn is_extra_name(name: &str) -> bool {
    let fixed = [&POSITION[..], &DC, &OPACITY, &SCALE, &ROTATION].concat();
    let digits = name.strip_prefix(REST_PREFIX).filter(|digits| !digits.is_empty());
    let is_rest = digits.is_some_and(|digits| digits.bytes().all(|digit| digit.is_ascii_digit()));
    let is_token = !name.is_empty() && !name.chars().any(|c| c.is_whitespace() || c.is_control());
    is_token && !fixed.contains(&name) && !is_rest
}

/// Most characters of a name or token from a file that a message repeats.
const SHOWN: usize = 48;

/// Makes a name or token from a file safe for a one-line message: escapes control characters, and cuts it.
pub(super) fn shown(text: &str) -> String {
    let mut out: String = text.chars().take(SHOWN).flat_map(char::escape_debug).collect();
    if text.chars().nth(SHOWN).is_some() {
        out.push_str("...");
    }
    out
}

/// Lists `names` for a message: the first few, and how many more there are.
pub(super) fn listed<S: AsRef<str>>(names: &[S]) -> String {
    /// Names spelt out before "and n more".
    const SPELT: usize = 6;
    let mut text = names.iter().take(SPELT).map(|n| shown(n.as_ref())).collect::<Vec<_>>().join(", ");
    if names.len() > SPELT {
        text.push_str(&format!(" and {} more", names.len() - SPELT));
    }
    text
}
