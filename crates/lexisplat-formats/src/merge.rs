//! Merges scenes into one.

use lexisplat::{Splats, unite};

/// Appends `next` to `scene`.
///
/// SH of the lower degree are raised to the higher degree, with zeros. Extra properties that do not exist in both scenes
/// with the same name and type are removed; their names are returned. Comments are those of both scenes, without
/// repetitions. Positions become relative to one offset ([`unite`]).
pub fn merge(scene: &mut Splats, mut next: Splats) -> Vec<String> {
    unite(scene, &mut next);
    raise(scene, &next);
    raise(&mut next, scene);
    let mut lost = Vec::new();
    let (ours, theirs) = (&mut scene.geometry.extras, &mut next.geometry.extras);
    let same = |a: &lexisplat::Extra, b: &lexisplat::Extra| {
        a.name == b.name && a.values.scalar_type() == b.values.scalar_type()
    };
    for (extras, others) in [(&*ours, &*theirs), (&*theirs, &*ours)] {
        for extra in extras.iter().filter(|extra| !others.iter().any(|other| same(extra, other))) {
            if !lost.contains(&extra.name) {
                lost.push(extra.name.clone());
            }
        }
    }
    ours.retain(|extra| theirs.iter().any(|other| same(extra, other)));
    // The extras are sorted into the order of those of `scene`.
    let order = |extra: &lexisplat::Extra| ours.iter().position(|other| same(extra, other));
    theirs.retain(|extra| order(extra).is_some());
    theirs.sort_by_key(|extra| order(extra));
    let (to, from) = (&mut scene.geometry.normals, &mut next.geometry.normals);
    if to.is_empty() != from.is_empty() {
        let (len, next_len) = (scene.geometry.positions.len(), next.geometry.positions.len());
        to.resize(len, [0.0; 3]);
        from.resize(next_len, [0.0; 3]);
    }
    for comment in std::mem::take(&mut next.meta.comments) {
        if !scene.meta.comments.contains(&comment) {
            scene.meta.comments.push(comment);
        }
    }
    scene.append(next);
    lost
}

/// Raises the SH degree of `scene` to that of `other`, if that is higher.
fn raise(scene: &mut Splats, other: &Splats) {
    if scene.degree >= other.degree {
        return;
    }
    let (from, to) = (scene.degree.rest_per_channel(), other.degree.rest_per_channel());
    let mut rest = vec![0.0; scene.len() * other.degree.rest()];
    if from > 0 {
        for (wide, narrow) in rest.chunks_exact_mut(to).zip(scene.sh_rest.chunks_exact(from)) {
            wide[..from].copy_from_slice(narrow);
        }
    }
    (scene.degree, scene.sh_rest) = (other.degree, rest);
}

#[cfg(test)]
mod tests {
    use lexisplat::{Extra, ExtraValues, Offset, ShDegree};
    use lexisplat_sample::{SampleOptions, scene};

    use super::*;

    fn extra(name: &str, values: ExtraValues) -> Extra {
        Extra { name: name.to_owned(), values }
    }

    #[test]
    fn scenes_with_different_offsets_stay_where_they_are() {
        let [mut a, b] = [0, 1].map(|seed| scene(&SampleOptions::new(20, seed)));
        let mut b = b;
        a.meta.offset = Offset::new([5e5, 0.0, 0.0]).unwrap();
        b.meta.offset = Offset::new([5e5 + 16.0, 8.0, 0.0]).unwrap();
        let world = |splats: &Splats, i: usize| {
            let by = Offset::numbers(splats.meta.offset);
            [0, 1, 2].map(|k| f64::from(splats.geometry.positions[i][k]) + by[k])
        };
        let expected: Vec<_> = [&a, &b].into_iter().flat_map(|s| (0..20).map(|i| world(s, i))).collect();
        merge(&mut a, b);
        for (i, expected) in expected.iter().enumerate() {
            let found = world(&a, i);
            assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-5), "{found:?} {expected:?}");
        }
    }

    #[test]
    fn scenes_of_different_degrees_and_properties_become_one() {
        let mut a = scene(&SampleOptions::new(20, 0));
        a.geometry.extras =
            vec![extra("x1", ExtraValues::U8(vec![1; 20])), extra("both", ExtraValues::F32(vec![2.0; 20]))];
        a.meta.comments = vec!["one".to_owned()];
        let mut b = scene(&SampleOptions::new(30, 1)).with_degree_cut(ShDegree::ONE);
        b.geometry.extras =
            vec![extra("both", ExtraValues::F32(vec![3.0; 30])), extra("x1", ExtraValues::I8(vec![1; 30]))];
        b.geometry.normals = vec![[0.0, 0.0, 1.0]; 30];
        b.meta.comments = vec!["one".to_owned(), "two".to_owned()];
        let (a_before, b_before) = (a.clone(), b.clone());
        let lost = merge(&mut a, b);
        assert_eq!(lost, ["x1"]);
        a.validate().unwrap();
        assert_eq!((a.len(), a.degree), (50, ShDegree::THREE));
        assert_eq!(a.rest(3), a_before.rest(3));
        for c in 0..3 {
            assert_eq!(a.rest(24)[c * 15..c * 15 + 3], b_before.rest(4)[c * 3..c * 3 + 3]);
            assert!(a.rest(24)[c * 15 + 3..(c + 1) * 15].iter().all(|v| *v == 0.0));
        }
        assert_eq!((a.geometry.normals[0], a.geometry.normals[20]), ([0.0; 3], [0.0, 0.0, 1.0]));
        assert_eq!(a.meta.comments, ["one", "two"]);
        // The other way round the first scene is raised.
        let mut b = b_before;
        merge(&mut b, a_before);
        b.validate().unwrap();
        assert_eq!((b.degree, b.geometry.extras.len()), (ShDegree::THREE, 1));
    }
}
