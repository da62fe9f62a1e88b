//! The tree of nodes, and the places of their meshes.

use lexisplat::{Error, Result};

use super::buffers::missing;
use super::document::{Document, Node};

/// An affine map: the columns of its linear part, and its translation.
pub(super) type Matrix = [[f64; 3]; 4];

/// The map that changes nothing.
const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]];
/// Largest difference of the last row of a matrix from (0, 0, 0, 1), in each entry.
const LAST_ROW: f64 = 1e-6;

/// A mesh at the place where a node shows it.
#[derive(Debug, PartialEq)]
pub(super) struct Shown {
    pub(super) node: usize,
    pub(super) mesh: usize,
    pub(super) matrix: Matrix,
}

/// Returns all meshes of the default scene, or else of the first scene, or else of all nodes.
///
/// # Errors
/// [`Error::Format`] for nodes that do not exist or are reached twice, and for transformations that are not affine.
pub(super) fn shown(name: &str, document: &Document<'_>) -> Result<Vec<Shown>> {
    let nodes = &document.nodes;
    let mut reached = vec![false; nodes.len()];
    let mut shown = Vec::new();
    // A stack replaces recursion, because nodes may be nested as deeply as there are nodes.
    let mut left: Vec<_> = roots(name, document)?.into_iter().rev().map(|root| (root, IDENTITY)).collect();
    while let Some((index, parent)) = left.pop() {
        let (Some(node), Some(is_reached)) = (nodes.get(index), reached.get_mut(index)) else {
            return Err(missing(name, "node", index));
        };
        if std::mem::replace(is_reached, true) {
            return Err(Error::malformed(name, format!("node {index} is reached twice")));
        }
        let matrix = product(&parent, &local(name, index, node)?);
        if !matrix.as_flattened().iter().all(|v| v.is_finite()) {
            return Err(Error::malformed(name, format!("the transformation of node {index} is not finite")));
        }
        shown.extend(node.mesh.map(|mesh| Shown { node: index, mesh, matrix }));
        // A list of more children than there are nodes has a child that is reached twice.
        left.extend(node.children.iter().rev().take(nodes.len() + 1).map(|&child| (child, matrix)));
        if left.len() > 2 * nodes.len() {
            return Err(Error::malformed(name, format!("children of node {index} are reached twice")));
        }
    }
    Ok(shown)
}

/// Returns the root nodes.
fn roots(name: &str, document: &Document<'_>) -> Result<Vec<usize>> {
    if let Some(scene) = document.scenes.get(document.scene.unwrap_or(0)) {
        return Ok(scene.nodes.clone());
    }
    if let Some(scene) = document.scene {
        return Err(missing(name, "scene", scene));
    }
    let mut is_child = vec![false; document.nodes.len()];
    for &child in document.nodes.iter().flat_map(|node| &node.children) {
        if let Some(is_child) = is_child.get_mut(child) {
            *is_child = true;
        }
    }
    Ok((0..is_child.len()).filter(|&k| !is_child[k]).collect())
}

/// Returns the map of a node relative to its parent.
fn local(name: &str, index: usize, node: &Node) -> Result<Matrix> {
    if let Some(matrix) = &node.matrix {
        let (columns, _) = matrix.as_chunks::<4>();
        let last = [0, 1, 2, 3].map(|k| columns.get(k).map_or(0.0, |column| column[3]));
        if last.iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(v, expected)| (v - expected).abs() > LAST_ROW) {
            return Err(Error::malformed(
                name,
                format!("the last row of the matrix of node {index} is {last:?}"),
            ));
        }
        return Ok(std::array::from_fn(|k| columns.get(k).map_or([0.0; 3], |[x, y, z, _]| [*x, *y, *z])));
    }
    let mut matrix = IDENTITY;
    if let Some([x, y, z, w]) = node.rotation {
        let length = (x * x + y * y + z * z + w * w).sqrt();
        if !(length > 0.0 && length.is_finite()) {
            return Err(Error::malformed(name, format!("the rotation of node {index} has length {length}")));
        }
        let q = [w, x, y, z].map(|v| v / length);
        for column in &mut matrix[..3] {
            *column = crate::quaternion::turned(q, *column);
        }
    }
    let scale = node.scale.unwrap_or([1.0; 3]);
    for (column, scale) in matrix.iter_mut().zip(scale) {
        *column = column.map(|v| v * scale);
    }
    matrix[3] = node.translation.unwrap_or_default();
    Ok(matrix)
}

/// Returns the map `b` followed by the map `a`.
fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut all = b.map(|column| [0, 1, 2].map(|row| (0..3).map(|k| a[k][row] * column[k]).sum()));
    all[3] = [0, 1, 2].map(|row| all[3][row] + a[3][row]);
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(json: &str) -> Result<Vec<Shown>> {
        shown("a", &serde_json::from_str(json).unwrap())
    }

    #[test]
    fn chains_of_transformations_are_multiplied() {
        // A quarter about z, by a matrix, of what is moved and made larger.
        let json = r#"{"scenes":[{"nodes":[]},{"nodes":[0]}],"scene":1,"nodes":[
            {"children":[1],"matrix":[0,1,0,0, -1,0,0,0, 0,0,1,0, 5,0,0,1]},
            {"mesh":3,"translation":[1,2,3],"scale":[2,2,2]}]}"#;
        let found = found(json).unwrap();
        let matrix = [[0.0, 2.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 2.0], [3.0, 1.0, 3.0]];
        assert_eq!(found, [Shown { node: 1, mesh: 3, matrix }]);
    }

    #[test]
    fn the_first_scene_or_all_nodes_are_shown() {
        let meshes = |json: &str| found(json).unwrap().iter().map(|shown| shown.mesh).collect::<Vec<_>>();
        let nodes = r#""nodes":[{"mesh":0},{"mesh":1,"children":[2]},{"mesh":2}]"#;
        assert_eq!(meshes(&format!(r#"{{"scenes":[{{"nodes":[1]}},{{"nodes":[0]}}],{nodes}}}"#)), [1, 2]);
        assert_eq!(meshes(&format!("{{{nodes}}}")), [0, 1, 2]);
    }

    #[test]
    fn trees_that_are_none_are_refused() {
        for (json, problem) in [
            (
                r#"{"scenes":[{"nodes":[0]}],"nodes":[{"children":[1]},{"children":[0]}]}"#,
                "node 0 is reached twice",
            ),
            (r#"{"scenes":[{"nodes":[0]}],"nodes":[{"children":[0]}]}"#, "node 0 is reached twice"),
            (r#"{"scenes":[{"nodes":[0,1]}],"nodes":[{"children":[1]},{}]}"#, "node 1 is reached twice"),
            (r#"{"scenes":[{"nodes":[0]}],"nodes":[{"children":[1,1]},{}]}"#, "node 1 is reached twice"),
            (r#"{"scenes":[{"nodes":[0]}],"nodes":[{"children":[9]}]}"#, "node 9 does not exist"),
            (r#"{"scene":4,"nodes":[{}]}"#, "scene 4 does not exist"),
            (r#"{"scenes":[{"nodes":[0]}],"nodes":[{"rotation":[0,0,0,0]}]}"#, "rotation of node 0"),
            (r#"{"nodes":[{"matrix":[1,0,0,1,0,1,0,0,0,0,1,0,0,0,0,1]}]}"#, "last row"),
            (r#"{"nodes":[{"scale":[1e300,1,1],"children":[1]},{"scale":[1e300,1,1]}]}"#, "not finite"),
        ] {
            let error = found(json).unwrap_err().to_string();
            assert!(error.contains(problem), "{error}");
        }
    }

    #[test]
    fn deep_trees_need_no_deep_stack() {
        let count = 200_000;
        let mut nodes: Vec<_> = (1..count).map(|k| format!(r#"{{"children":[{k}]}}"#)).collect();
        nodes.push(r#"{"mesh":7}"#.to_owned());
        let json = format!(r#"{{"scenes":[{{"nodes":[0]}}],"nodes":[{}]}}"#, nodes.join(","));
        assert_eq!(found(&json).unwrap()[0].mesh, 7);
    }
}
