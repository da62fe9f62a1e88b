//! Writes the first inputs of every fuzz target, made of the procedural sample scene: every dialect, layout and
//! degree, small.
//!
//! `seeds corpus` writes to `corpus/TARGET/seed-NAME`. Built by `cargo fuzz build` with the targets, so that there
//! is one build.

use std::collections::HashSet;
use std::error::Error;
use std::fmt::Write as _;
use std::fs;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use flate2::read::GzDecoder;
use lexisplat::lexi::{LexiReader, LexiWriter};
use lexisplat::packed::fuzzing;
use lexisplat::packed::{PackOptions, Packer, RangeKind, ReachedRecord, TargetRecord};
use lexisplat::{
    CompressOptions, Extra, ExtraValues, Layout, Limits, Sensitivity, ShDegree, Silent, Splats, compress,
    lexi, ply,
};
use lexisplat_formats::{Kind, WriteOptions};
use lexisplat_fuzz::container::FEED_SCRIPT;
use lexisplat_render::{Camera, orbit};
use lexisplat_sample::{SampleOptions, scene};
// The build with coverage calls this crate.
use libfuzzer_sys as _;

type Done = Result<(), Box<dyn Error>>;

/// Gaussians of most seeds: a fuzzer is as quick as its inputs are small.
const FEW: usize = 6;
/// Rows that a PLY reader takes at once.
const CHUNK_ROWS: usize = 1024;
/// Atoms of seeds, so that dictionaries are small.
const ATOMS: usize = 4;

/// First bytes of gzip.
const GZIP: [u8; 2] = [0x1f, 0x8b];
/// Members of a SOG as their reader asks for them.
const MEMBERS: [&str; 8] = [
    "meta.json",
    "means_l.webp",
    "means_u.webp",
    "quats.webp",
    "scales.webp",
    "sh0.webp",
    "shN_centroids.webp",
    "shN_labels.webp",
];

fn main() -> Done {
    let root = PathBuf::from(std::env::args_os().nth(1).ok_or("name the folder to write to")?);
    plys(&root)?;
    exact(&root)?;
    packed(&root)?;
    cameras(&root)?;
    formats(&root)?;
    made(&root)
}

fn save(root: &Path, target: &str, name: &str, bytes: &[u8]) -> Done {
    let folder = root.join(target);
    fs::create_dir_all(&folder)?;
    fs::write(folder.join(format!("seed-{name}")), bytes)?;
    Ok(())
}

/// A sample of any degree; beyond 3 the highest coefficients repeat lower ones.
fn sample(gaussians: usize, degree: ShDegree) -> Splats {
    let splats = scene(&SampleOptions::new(gaussians, 7));
    if degree <= splats.degree {
        return splats.with_degree_cut(degree);
    }
    let (from, to) = (splats.degree.rest_per_channel(), degree.rest_per_channel());
    let longer = |channel: &[f32]| channel.iter().copied().cycle().take(to).collect::<Vec<f32>>();
    let sh_rest = splats.sh_rest.chunks_exact(from).flat_map(longer).collect();
    Splats { sh_rest, degree, ..splats }
}

fn with_extras(mut splats: Splats) -> Splats {
    let n = u8::try_from(splats.len()).unwrap_or(0);
    let extra = |name: &str, values| Extra { name: name.to_owned(), values };
    splats.geometry.extras = vec![
        extra("label", ExtraValues::U8((0..n).collect())),
        extra("time", ExtraValues::F64((0..n).map(f64::from).collect())),
    ];
    splats.geometry.normals = vec![[0.0, 1.0, 0.0]; splats.len()];
    splats.meta.comments = vec!["SplatRenderMode: mip".to_owned(), "made for a test".to_owned()];
    splats
}

fn degrees() -> impl Iterator<Item = ShDegree> {
    (0..=4).filter_map(|degree| ShDegree::new(degree).ok())
}

fn plys(root: &Path) -> Done {
    for degree in degrees() {
        let mut bytes = Vec::new();
        ply::write(&mut bytes, &with_extras(sample(3, degree)))?;
        save(root, "ply", &format!("binary-{degree}"), &bytes)?;
    }
    // The same Gaussians as other trainers write them.
    let degree = ShDegree::ONE;
    let splats = sample(2, degree);
    let mut names: Vec<String> = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"].map(str::to_owned).to_vec();
    names.extend((0..degree.rest()).map(|k| format!("f_rest_{k}")));
    names.extend(
        ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"].map(str::to_owned),
    );
    let g = &splats.geometry;
    let row = |i: usize| -> Vec<f32> {
        let groups: [&[f32]; 6] =
            [&g.positions[i], &g.dc[i], splats.rest(i), &g.opacities[i..=i], &g.scales[i], &g.rotations[i]];
        groups.concat()
    };
    for (name, format, ty, end) in [
        ("ascii", "ascii", "float", "\n"),
        ("ascii-crlf", "ascii", "double", "\r\n"),
        ("big-endian", "binary_big_endian", "float", "\n"),
        ("doubles", "binary_little_endian", "float64", "\n"),
    ] {
        let mut header = format!("ply{end}format {format} 1.0{end}comment antialiased 1{end}");
        write!(header, "element vertex {}{end}", splats.len())?;
        for property in names.iter().rev() {
            write!(header, "property {ty} {property}{end}")?;
        }
        write!(header, "element face 1{end}property list uchar int vertex_indices{end}end_header{end}")?;
        let mut bytes = header.into_bytes();
        for i in 0..splats.len() {
            let row: Vec<f32> = row(i).into_iter().rev().collect();
            match (format, ty) {
                ("ascii", _) => {
                    let words: Vec<String> = row.iter().map(f32::to_string).collect();
                    bytes.extend_from_slice(format!("{}{end}", words.join(" ")).as_bytes());
                }
                ("binary_big_endian", _) => row.iter().for_each(|v| bytes.extend(v.to_be_bytes())),
                _ => row.iter().for_each(|v| bytes.extend(f64::from(*v).to_le_bytes())),
            }
        }
        let face: &[u8] = if format == "ascii" { b"3 0 1 2\n" } else { &[1, 0, 0, 0, 0] };
        bytes.extend_from_slice(face);
        save(root, "ply", name, &bytes)?;
    }
    long_ply(root)
}

/// Rows of one byte a property, more than a reader takes at once.
fn long_ply(root: &Path) -> Done {
    let rows = CHUNK_ROWS + 40;
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let mut header = format!("ply\nformat binary_little_endian 1.0\nelement vertex {rows}\n");
    for name in names.split(' ') {
        writeln!(header, "property char {name}")?;
    }
    header.push_str("end_header\n");
    let values = (0..rows * names.split(' ').count()).map(|k| (k * 7 % 251).to_le_bytes()[0]);
    save(root, "ply", "long", &header.into_bytes().into_iter().chain(values).collect::<Vec<u8>>())
}

fn exact(root: &Path) -> Done {
    for layout in [Layout::F32, Layout::F16, Layout::Paper] {
        for degree in degrees() {
            let mut splats = with_extras(sample(FEW, degree));
            // Rows that no few atoms come near: escapes.
            if degree != ShDegree::ZERO {
                splats.sh_rest[..degree.rest()].fill(1e6);
                splats.sh_rest[4 * degree.rest()..][..degree.rest()].fill(-1e6);
            }
            let mut options = CompressOptions::default();
            options.values = layout.values();
            options.atoms = Some(if layout == Layout::F32 && degree == ShDegree::ONE { 300 } else { ATOMS });
            let (model, _) = compress(splats, &options, &Silent)?;
            let mut bytes = Vec::new();
            LexiWriter::exact(&model, layout.codes())?.write(&mut bytes, &Silent)?;
            let name = format!("{layout}-{degree}");
            save(root, "lexi", &name, &bytes)?;
            save(root, "dictionary", &name, &bytes)?;
            if degree != ShDegree::ZERO {
                let path = root.join("dictionary").join(format!("seed-alone-{name}"));
                lexi::write_dictionary(&path, model.dictionary())?;
            }
        }
    }
    Ok(())
}

fn packed(root: &Path) -> Done {
    for degree in degrees() {
        for (gaussians, rich) in [(1, false), (2, false), (40, false), (40, true)] {
            let mut splats = sample(gaussians, degree);
            let mut options = PackOptions::default();
            options.atoms = (degree != ShDegree::ZERO).then_some(ATOMS);
            if rich {
                splats = with_extras(splats);
                options.keep_order = true;
                options.tolerance = Some(0.05);
                if degree != ShDegree::ZERO {
                    splats.sh_rest[..degree.rest()].fill(1e6);
                }
            }
            let sensitivity = Sensitivity::guess(&splats.geometry);
            let packer = Packer::new(&splats, &sensitivity, &options)?;
            let (packed, _) = packer.pack(1e-3, &Silent)?;
            let target = rich.then(|| TargetRecord::new("size", 3000.0, [31.5, 25.0], 18, false));
            let reached = rich.then(|| ReachedRecord::new([28.5, 31.5, 25.0], 18, false));
            let packed = packed.with_target(target).with_reached(reached);
            let mut bytes = Vec::new();
            LexiWriter::packed(&packed).write(&mut bytes, &Silent)?;
            let name = format!("{degree}-{gaussians}{}", if rich { "-rich" } else { "" });
            save(root, "packed", &name, &bytes)?;
            fed(root, &name, &bytes)?;
            if gaussians == 2 {
                save(root, "dictionary", &format!("packed-{name}"), &bytes)?;
            }
            // Tables and data without the container.
            let script: Vec<u8> = (0..64).flat_map(|k: u8| [k % 5, k, k / 3, 1, 0]).collect();
            let [tables, range] = fuzzing::parts(&packed);
            let entropy = alone(&[0, 0], &[&tables, &range], &script);
            save(root, "entropy", &format!("decode-{name}"), &entropy)?;
        }
    }
    let script: Vec<u8> = (0..60).flat_map(|k: u8| [k, k % 59, k % 24, k, k, 2, k, k]).collect();
    save(root, "entropy", "round-trip", &[&[1, 3][..], &script].concat())?;
    several_layers(root)
}

/// Packed files of two layers, with interim changes, two levels of refinement and three parts of nonzeros.
fn several_layers(root: &Path) -> Done {
    for degree in degrees() {
        for (gaussians, points) in [(20, 0), (60, 2)] {
            let mut splats = sample(gaussians, degree);
            let mut options = PackOptions::default();
            options.layers_from = 0;
            options.points_of_view = [[0.0, -1.0, -4.0], [3.0, -1.0, 2.0]][..points].to_vec();
            if degree != ShDegree::ZERO {
                options.atoms = Some(ATOMS);
                splats.sh_rest[..degree.rest()].fill(1e6);
            }
            let sensitivity = Sensitivity::guess(&splats.geometry);
            let (packed, _) = Packer::new(&splats, &sensitivity, &options)?.pack(1e-4, &Silent)?;
            let mut bytes = Vec::new();
            LexiWriter::packed(&packed).write(&mut bytes, &Silent)?;
            let reader = LexiReader::open("layered", &bytes, &Limits::default())?;
            let outline = reader.outline().ok_or("no packed file")?;
            let kinds: HashSet<RangeKind> = outline.ranges.iter().map(|range| range.kind).collect();
            let mut wanted = vec![RangeKind::Base, RangeKind::Refinement(1), RangeKind::Interim];
            wanted.extend((degree != ShDegree::ZERO).then_some(RangeKind::Sh(2)));
            if outline.layers.len() < 2 || !wanted.iter().all(|kind| kinds.contains(kind)) {
                return Err(
                    format!("a scene of {gaussians} has no layers, or not all kinds of ranges").into()
                );
            }
            let name = format!("layered-{degree}-{gaussians}");
            save(root, "packed", &name, &bytes)?;
            fed(root, &name, &bytes)?;
        }
    }
    Ok(())
}

/// A file, and how it is fed.
fn fed(root: &Path, name: &str, bytes: &[u8]) -> Done {
    for how in 0..3_u8 {
        let script =
            (0..FEED_SCRIPT).map(|k| (how * 91).wrapping_add(u8::try_from(k * 67 % 251).unwrap_or(0)));
        // One without limits, all of it.
        let script: Vec<u8> = script.map(|byte| if how == 0 { 0 } else { byte }).collect();
        save(root, "feed", &format!("{name}-{how}"), &[bytes, &script].concat())?;
    }
    Ok(())
}

/// Tables and data with their lengths before them, and a script.
fn alone(kind: &[u8], parts: &[&[u8]], script: &[u8]) -> Vec<u8> {
    let lengths = parts.iter().flat_map(|part| u16::try_from(part.len()).unwrap_or(u16::MAX).to_le_bytes());
    [kind, &lengths.collect::<Vec<u8>>(), &parts.concat(), script].concat()
}

fn cameras(root: &Path) -> Done {
    let splats = sample(40, ShDegree::ZERO);
    let views = orbit(&splats.geometry, 3, 64, 48);
    let json = |camera: &Camera| {
        serde_json::json!({
            "id": 0, "img_name": camera.name, "width": camera.width, "height": camera.height,
            "position": camera.position, "rotation": camera.rotation, "fx": camera.fx, "fy": camera.fy,
        })
    };
    let list: Vec<_> = views.iter().map(json).collect();
    save(root, "cameras_json", "orbit", serde_json::to_string(&list)?.as_bytes())?;
    let mut one = list[0].clone();
    one["split"] = "test".into();
    save(root, "cameras_json", "split", serde_json::to_string_pretty(&[one])?.as_bytes())?;

    let matrix = |camera: &Camera| -> Vec<[f32; 4]> {
        let r = &camera.rotation;
        let row = |i: usize| [r[i][0], -r[i][1], -r[i][2], camera.position[i]];
        vec![row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]
    };
    let frames: Vec<_> = views
        .iter()
        .map(|c| serde_json::json!({"file_path": format!("./images/{}.png", c.name), "transform_matrix": matrix(c)}))
        .collect();
    let nerf = serde_json::json!({"camera_angle_x": 0.69, "frames": frames});
    save(root, "transforms", "nerf", nerf.to_string().as_bytes())?;
    let nerfstudio = serde_json::json!({
        "camera_model": "OPENCV", "fl_x": 51.5, "fl_y": 51.0, "cx": 32, "cy": 24.5, "w": 64, "h": 48, "k1": 0,
        "distortion_params": [0, 0], "is_fisheye": false, "frames": frames,
        "train_filenames": ["images/orbit_000.png"], "test_filenames": ["./images/orbit_001.png"],
        "val_filenames": [],
    });
    save(root, "transforms", "nerfstudio", serde_json::to_string_pretty(&nerfstudio)?.as_bytes())?;
    let mut frame = frames[0].clone();
    for (key, value) in [("fl_x", 51.5), ("w", 64.0), ("h", 48.0), ("camera_angle_y", 0.5)] {
        frame[key] = value.into();
    }
    save(root, "transforms", "frame", serde_json::json!({"frames": [frame]}).to_string().as_bytes())?;
    colmap(root)
}

/// Two cameras, two images of each.
fn colmap(root: &Path) -> Done {
    let mut files = [2_u64.to_le_bytes().to_vec(), 4_u64.to_le_bytes().to_vec()];
    for (number, model, parameters) in
        [(1_u32, 0_u32, &[50.0, 32.0, 24.0][..]), (2, 1, &[50.0, 51.0, 32.0, 24.0])]
    {
        files[0].extend(number.to_le_bytes());
        files[0].extend(model.to_le_bytes());
        files[0].extend(64_u64.to_le_bytes());
        files[0].extend(48_u64.to_le_bytes());
        parameters.iter().for_each(|p: &f64| files[0].extend(p.to_le_bytes()));
    }
    for image in 1..=4_u32 {
        files[1].extend(image.to_le_bytes());
        [1.0, 0.1, 0.0, 0.2, 0.5, -1.0, f64::from(image)]
            .iter()
            .for_each(|v| files[1].extend(v.to_le_bytes()));
        files[1].extend((1 + image % 2).to_le_bytes());
        files[1].extend(format!("images/{image}.jpg\0").as_bytes());
        files[1].extend(1_u64.to_le_bytes());
        files[1].extend([0; 24]);
    }
    save(root, "colmap", "binary", &joined(0, &files[0], &files[1])?)?;
    let cameras = "# Camera list\n1 SIMPLE_PINHOLE 64 48 50 32 24\n2 PINHOLE 64 48 50 51 32 24\n";
    let mut images = "# Image list\n# Number of images: 4, mean observations per image: 1\n".to_owned();
    for image in 1..=4 {
        let camera = 1 + image % 2;
        write!(images, "{image} 1 0.1 0 0.2 0.5 -1 {image} {camera} images/{image}.jpg\n1.5 2.5 -1\n")?;
    }
    save(root, "colmap", "text", &joined(1, cameras.as_bytes(), images.as_bytes())?)
}

fn joined(kind: u8, cameras: &[u8], images: &[u8]) -> Result<Vec<u8>, Box<dyn Error>> {
    let length = u16::try_from(cameras.len())?.to_le_bytes();
    Ok([&[kind], &length[..], cameras, images].concat())
}

/// Files of other programs' formats: every one that is written, and the .ksplat of the tests.
fn formats(root: &Path) -> Done {
    for degree in degrees() {
        let mut splats = sample(FEW, degree);
        splats.meta.antialiased = degree == ShDegree::ONE;
        for kind in Kind::WRITTEN {
            for variant in 0..3 {
                let mut options = WriteOptions::default();
                options.spz_version = 2 + variant;
                options.sog_palette = if variant == 0 { 0 } else { 1 << 16 };
                let mut bytes = Vec::new();
                lexisplat_formats::write(kind, &splats, &options, &mut bytes, &Silent)?;
                let name = format!("{degree}-{variant}");
                match kind {
                    Kind::Spz => {
                        save(root, "spz", &name, &[&[0], &bytes[..]].concat())?;
                        if bytes.starts_with(&GZIP) {
                            let mut plain = vec![1];
                            GzDecoder::new(&bytes[..]).read_to_end(&mut plain)?;
                            save(root, "spz", &format!("plain-{name}"), &plain)?;
                        }
                    }
                    Kind::Sog => {
                        save(root, "sog", &name, &[&[0], &bytes[..]].concat())?;
                        save(root, "sog", &format!("pieces-{name}"), &pieces(&bytes)?)?;
                    }
                    Kind::CompressedPly => save(root, "compressed_ply", &name, &bytes)?,
                    Kind::Splat => save(root, "splat", &name, &bytes)?,
                    Kind::Gltf => save(root, "gltf", &name, &bytes)?,
                    _ => {}
                }
            }
        }
    }
    let fixtures = concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/lexisplat-formats/tests/data");
    for file in fs::read_dir(fixtures)? {
        let path = file?.path();
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("ksplat") => save(root, "ksplat", &name, &fs::read(&path)?)?,
            Some("glb" | "gltf") => save(root, "gltf", &name, &fs::read(&path)?)?,
            _ => {}
        }
    }
    Ok(())
}

/// The members of the zip archive `bytes`, which are stored, each after its length: `meta.json` first, then the others in
/// the order in which they are asked for.
fn pieces(bytes: &[u8]) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut found = vec![Vec::new(); MEMBERS.len()];
    let mut rest = bytes;
    while let [b'P', b'K', 3, 4, ..] = rest {
        let size = u32::from_le_bytes(rest[18..22].try_into()?) as usize;
        let name = usize::from(u16::from_le_bytes(rest[26..28].try_into()?));
        let (head, content) = rest[30..].split_at(name);
        let (content, after) = content.split_at(size);
        let index = MEMBERS.iter().position(|member| member.as_bytes() == head).ok_or("an unknown member")?;
        found[index] = content.to_vec();
        rest = after;
    }
    let mut all = vec![1];
    for content in found {
        all.extend(u16::try_from(content.len())?.to_le_bytes());
        all.extend(content);
    }
    Ok(all)
}

/// Scenes as bytes: what to do, how, degree, count, whether copies, then values.
fn made(root: &Path) -> Done {
    for what in 0..6_u8 {
        for degree in 0..5_u8 {
            for how in [0, 5, 0x1b, 0xf6] {
                let mut bytes = vec![what, how, degree, 1 + degree * 2, u8::from(how == 5)];
                bytes.extend(
                    (0..1200_u32).map(|k| u8::try_from((k * 37 + u32::from(how)) % 0xc0).unwrap_or(0)),
                );
                save(root, "scene", &format!("{what}-{degree}-{how}"), &bytes)?;
            }
        }
    }
    save(root, "scene", "empty", &[0, 0, 3, 0])
}
