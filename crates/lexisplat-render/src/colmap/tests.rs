//! Made-up models as both kinds of files, and damage to them.

use super::*;
use crate::camera::Camera;

/// Bytes of the two files of a model.
type Files = [Vec<u8>; 2];
type Read = fn(&Files) -> Result<ViewSet>;

struct Image {
    name: &'static str,
    camera: u32,
    /// Quaternion (w, x, y, z), then translation.
    pose: [f64; 7],
    points: u64,
}

/// Half the square root of two doubled: cosine of 45 degrees.
const C: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Cameras: number, model's number, size, parameters.
const CAMERAS: [(u32, u32, [u64; 2], &[f64]); 2] =
    [(7, 1, [800, 533], &[620.5, 619.25, 400.25, 266.5]), (2, 0, [640, 480], &[500.0, 332.3, 240.0])];

const IMAGES: [Image; 3] = [
    Image { name: "right/b.JPG", camera: 7, pose: [C, 0.0, C, 0.0, 1.0, 2.0, 3.0], points: 2 },
    Image { name: "left/a photo.png", camera: 2, pose: [1.0, 0.0, 0.0, 0.0, 0.5, 0.0, -4.0], points: 0 },
    // Of twice the unit length.
    Image { name: "c.jpg", camera: 7, pose: [1.0, 1.0, 1.0, 1.0, -0.1, 1e-3, 7.0], points: 1 },
];

fn binary() -> Files {
    let (mut cameras, mut images) = (2_u64.to_le_bytes().to_vec(), 3_u64.to_le_bytes().to_vec());
    for (number, model, size, parameters) in CAMERAS {
        cameras.extend(number.to_le_bytes());
        cameras.extend(model.to_le_bytes());
        size.iter().for_each(|side| cameras.extend(side.to_le_bytes()));
        parameters.iter().for_each(|value| cameras.extend(value.to_le_bytes()));
    }
    for (number, image) in (40_u32..).zip(&IMAGES) {
        images.extend(number.to_le_bytes());
        image.pose.iter().for_each(|value| images.extend(value.to_le_bytes()));
        images.extend(image.camera.to_le_bytes());
        images.extend(image.name.as_bytes());
        images.push(0);
        images.extend(image.points.to_le_bytes());
        (0..image.points).for_each(|_| images.extend([0xAB; 24]));
    }
    [cameras, images]
}

fn text() -> Files {
    let names = ["SIMPLE_PINHOLE", "PINHOLE"];
    let (mut cameras, mut images) =
        (String::from("# Camera list\n"), String::from("# Image list\n# Number of images: 3, mean: 1\n"));
    for (number, model, [width, height], parameters) in CAMERAS {
        let words: Vec<String> = parameters.iter().map(ToString::to_string).collect();
        let model = names[usize::try_from(model).unwrap()];
        cameras += &format!("{number} {model} {width} {height} {}\r\n", words.join(" "));
    }
    for (number, image) in (40..).zip(&IMAGES) {
        let words: Vec<String> = image.pose.iter().map(ToString::to_string).collect();
        let points = vec!["1.5 2.5 -1"; usize::try_from(image.points).unwrap()].join(" ");
        images += &format!("{number} {} {} {}\n{points}\n", words.join(" "), image.camera, image.name);
    }
    [cameras.into_bytes(), images.into_bytes()]
}

fn read_binary([cameras, images]: &Files) -> Result<ViewSet> {
    read_colmap_binary("made", cameras, images)
}

fn read_text([cameras, images]: &Files) -> Result<ViewSet> {
    read_colmap_text("made", cameras, images)
}

fn named<'a>(set: &'a ViewSet, name: &str) -> &'a Camera {
    set.cameras.iter().find(|camera| camera.name == name).unwrap()
}

#[test]
fn both_kinds_of_files_give_the_same_cameras_in_order_of_names() {
    let set = read_binary(&binary()).unwrap();
    let names: Vec<&str> = set.cameras.iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["c.jpg", "left/a photo.png", "right/b.JPG"]);
    assert!(set.cameras.iter().all(|camera| camera.split.is_none()));
    let simple = named(&set, "left/a photo.png");
    assert_eq!((simple.width, simple.height, simple.fx, simple.fy), (640, 480, 500.0, 500.0));
    let two = named(&set, "c.jpg");
    assert_eq!((two.width, two.height, two.fx, two.fy), (800, 533, 620.5, 619.25));
    assert_eq!(set.warnings.len(), 1, "{:?}", set.warnings);
    assert!(set.warnings[0].starts_with("principal point of 1 camera is up to 12.3 pixels"));
    assert_eq!(read_text(&text()).unwrap(), set);
}

#[test]
fn poses_are_those_of_colmap() {
    // A quarter turn about y takes x to -z and z to x, then the translation is added: worked by hand.
    let set = read_binary(&binary()).unwrap();
    let camera = named(&set, "right/b.JPG");
    let near = |found: [f32; 3], wanted: [f32; 3]| {
        assert!(
            found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-5),
            "{found:?}, expected {wanted:?}"
        );
    };
    near(camera.to_view([4.0, 5.0, 6.0]), [6.0 + 1.0, 5.0 + 2.0, -4.0 + 3.0]);
    near(camera.position, [3.0, -2.0, -1.0]);
    // The quaternion (1, 1, 1, 1) takes x to y, y to z and z to x, whatever its length.
    near(named(&set, "c.jpg").to_view([1.0, 2.0, 3.0]), [3.0 - 0.1, 1.0 + 1e-3, 2.0 + 7.0]);
    near(named(&set, "left/a photo.png").position, [-0.5, 0.0, 4.0]);
}

#[test]
fn other_lenses_are_refused_by_name() {
    for (number, name) in
        [(2, "SIMPLE_RADIAL"), (4, "OPENCV"), (11, "RAD_TAN_THIN_PRISM_FISHEYE"), (77, "77")]
    {
        let [mut cameras, images] = binary();
        cameras[12] = number;
        let message = read_binary(&[cameras, images]).unwrap_err().to_string();
        assert!(message.contains("cameras.bin: camera 7: model ") && message.contains(name), "{message}");
        assert!(message.contains("colmap image_undistorter"), "{message}");
    }
    let [cameras, images] = text();
    let cameras = String::from_utf8(cameras).unwrap().replace(" PINHOLE", " RADIAL");
    let message = read_text(&[cameras.into_bytes(), images]).unwrap_err().to_string();
    assert!(message.contains("cameras.txt: line 2: camera 7: model RADIAL"), "{message}");
}

#[test]
fn errors_name_the_file_the_place_and_the_value() {
    let [cameras, images] = text().map(|bytes| String::from_utf8(bytes).unwrap());
    let cases = [
        (0, "800 533", "0 533", "camera 7: width is 0"),
        (0, "800 533", "800 99999", "camera 7: height is 99999"),
        (0, "800 533", "800.5 533", "camera 7: width is '800.5'"),
        (0, "620.5", "-1", "camera 7: focal length is -1"),
        (0, "620.5", "inf", "camera 7: focal length is inf"),
        (0, "400.25", "NaN", "camera 7: principal point is at NaN"),
        (0, " 266.5", "", "camera 7: 3 parameters"),
        (0, "2 SIMPLE", "7 SIMPLE", "there are two of this number"),
        (0, "2 SIMPLE_PINHOLE 640 480 500 332.3 240", "2", "line 3: not a camera"),
        (0, "2 SIMPLE", "3 SIMPLE", "image 'left/a photo.png': its camera 2 is not in"),
        (1, " 7 c.jpg", "", "line 7: not an image"),
        (1, "1 1 1 1", "0 0 0 0", "image 'c.jpg': not a pose"),
        (1, "1 1 1 1", "1 1 nan 1", "image 'c.jpg': not a pose"),
        (1, "1 1 1 1", "1 1 i 1", "image 42: pose is 'i'"),
        (1, "-4", "1e60", "image 'left/a photo.png': position"),
        (1, "2.5 -1\n4", "2.5\n4", "5 words, expected the points"),
        (1, "\n\n", "\n", "10 words, expected the points"),
    ];
    for (file, from, to, problem) in cases {
        let mut files = [cameras.clone(), images.clone()];
        files[file] = files[file].replacen(from, to, 1);
        assert_ne!(files, [cameras.clone(), images.clone()], "{from}");
        let message = read_text(&files.map(String::into_bytes)).unwrap_err().to_string();
        assert!(message.contains(problem), "{message}");
        assert!(message.starts_with("made"), "{message}");
    }
}

#[test]
fn a_text_that_says_another_number_is_told() {
    let [cameras, images] = text();
    let images = String::from_utf8(images).unwrap();
    let end = images.find("42 ").unwrap();
    let set = read_text(&[cameras, images.as_bytes()[..end].to_vec()]).unwrap();
    assert_eq!(set.cameras.len(), 2);
    assert_eq!(set.warnings[0], "images.txt says that there are 3 images and has 2");
}

#[test]
fn counts_are_not_believed() {
    let [cameras, images] = binary();
    let with = |bytes: &[u8], at: usize, count: u64| {
        let mut bytes = bytes.to_vec();
        bytes[at..at + 8].copy_from_slice(&count.to_le_bytes());
        bytes
    };
    // The points of the first image, after its number, pose, camera and name.
    let points = 8 + 4 + 56 + 4 + IMAGES[0].name.len() + 1;
    for count in [4, 1 << 20, u64::MAX / 24 + 1, u64::MAX] {
        for files in [
            [with(&cameras, 0, count), images.clone()],
            [cameras.clone(), with(&images, 0, count)],
            [cameras.clone(), with(&images, points, count)],
        ] {
            assert!(
                matches!(read_binary(&files), Err(Error::Codec(lexisplat::Error::Format { .. }))),
                "{count}"
            );
        }
    }
    // Enough bytes for more images than are allowed.
    let many = u64::try_from(crate::MAX_CAMERAS).unwrap() + 1;
    let mut bytes = many.to_le_bytes().to_vec();
    bytes.resize(8 + 73 * (crate::MAX_CAMERAS + 1), 0);
    assert!(
        matches!(read_binary(&[cameras.clone(), bytes]), Err(Error::Codec(lexisplat::Error::Limit { found, .. })) if found == many)
    );
    let long = [cameras, [images, vec![0]].concat()];
    assert!(read_binary(&long).unwrap_err().to_string().contains("1 bytes follow"));
}

#[test]
fn every_truncation_is_an_error() {
    let [cameras, images] = binary();
    for end in 0..cameras.len() {
        assert!(read_colmap_binary("made", &cameras[..end], &images).is_err(), "cameras {end}");
    }
    for end in 0..images.len() {
        assert!(read_colmap_binary("made", &cameras, &images[..end]).is_err(), "images {end}");
    }
    // Text ends anywhere; it must not panic, and what is read is valid.
    let [cameras, images] = text();
    for end in 0..images.len() {
        let set = read_colmap_text("made", &cameras, &images[..end]);
        assert!(set.is_err() || set.is_ok_and(|set| set.cameras.len() <= 3));
        let set = read_colmap_text("made", &cameras[..end.min(cameras.len())], &images);
        assert!(set.is_err() || set.is_ok_and(|set| set.cameras.len() == 3));
    }
}

#[test]
fn damage_is_refused_or_gives_valid_cameras() {
    let mut state = 0x1234_5678_9ABC_DEF1_u64;
    let mut random = move || {
        // Marsaglia's xorshift64.
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let read: [(Files, Read); 2] = [(binary(), read_binary), (text(), read_text)];
    let (mut refused, mut accepted) = (0, 0);
    for round in 0..6000 {
        let (files, read) = &read[round % 2];
        let mut files = files.clone();
        for _ in 0..=random() % 4 {
            let file = &mut files[usize::try_from(random() % 2).unwrap()];
            let at = usize::try_from(random() % file.len() as u64).unwrap();
            match random() % 3 {
                0 => file[at] ^= 1 << (random() % 8),
                1 => file[at] = random().to_le_bytes()[0],
                _ => drop(file.remove(at)),
            }
        }
        match read(&files) {
            Ok(set) => {
                accepted += 1;
                set.cameras.iter().for_each(|camera| camera.validate().unwrap());
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().starts_with("made"), "{error}");
            }
        }
    }
    assert!(refused > 1000 && accepted > 1000, "{refused} {accepted}");
}
