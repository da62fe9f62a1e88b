//! Made-up files of each tool, and damage to them.

use super::*;

const NERFSTUDIO: &str = r#"{
    "camera_model": "OPENCV", "w": 800, "h": 600.0, "fl_x": 700.5, "fl_y": 701.5, "cx": 412.3, "cy": 300,
    "k1": 0.0, "k2": 0, "p1": 0.0, "p2": 0.0, "applied_transform": [[0, 0, 1, 0]], "ply_file_path": "a.ply",
    "train_filenames": ["images/a.jpg"], "val_filenames": ["./images/b.jpg"],
    "frames": [
        {"file_path": "./images/a.jpg", "colmap_im_id": 3, "mask_path": null,
         "transform_matrix": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]},
        {"file_path": "images/b.jpg", "fl_x": 350, "w": 400, "h": 300, "cx": 200, "cy": 150,
         "transform_matrix": [[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]},
        {"file_path": "images/c.jpg", "transform_matrix": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3]]}
    ]}"#;

const NERF: &str = r#"{"camera_angle_x": 1.5707963267948966, "frames": [
    {"file_path": "./train/r_0", "rotation": 0.01,
     "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]}]}"#;

fn parse(text: &str) -> Result<ViewSet> {
    read_transforms_bytes("transforms.json", text.as_bytes(), &mut |_| None)
}

#[test]
fn reads_what_nerfstudio_writes() {
    let set = parse(NERFSTUDIO).unwrap();
    let [a, b, c] = set.cameras.as_slice() else { panic!("{set:?}") };
    assert_eq!((a.name.as_str(), a.width, a.height), ("./images/a.jpg", 800, 600));
    assert_eq!((a.fx, a.fy, a.position), (700.5, 701.5, [1.0, 2.0, 3.0]));
    // The file's camera looks along -z with y up: a point 5 before it and 2 above is at y = -2.
    assert_eq!(a.to_view([1.0, 4.0, -2.0]), [0.0, -2.0, 5.0]);
    // Its own focal length, and the same for y.
    assert_eq!((b.width, b.height, b.fx, b.fy), (400, 300, 350.0, 350.0));
    // Right is world y, up is z, back is x.
    assert_eq!(b.to_view([-3.0, 1.0, 2.0]), [1.0, -2.0, 3.0]);
    assert_eq!(c.position, [1.0, 2.0, 3.0]);
    let splits = set.cameras.iter().map(|camera| camera.split).collect::<Vec<_>>();
    assert_eq!(splits, [Some(Split::Train), Some(Split::Test), None]);
    assert_eq!(set.warnings.len(), 1);
    assert!(set.warnings[0].starts_with("principal point of 2 cameras is up to 12.3 pixels"));
}

#[test]
fn validation_is_not_testing_where_there_is_a_test_list() {
    let text =
        NERFSTUDIO.replace("\"frames\"", "\"test_filenames\": [\"images/c.jpg\", \"gone\"], \"frames\"");
    let set = parse(&text).unwrap();
    let splits = set.cameras.iter().map(|camera| camera.split).collect::<Vec<_>>();
    assert_eq!(splits, [Some(Split::Train), None, Some(Split::Test)]);
    assert!(set.warnings[0].starts_with("1 of the names listed for the test split"), "{:?}", set.warnings);
    let both = NERFSTUDIO.replace("./images/b.jpg\"]", "images/a.jpg\"]");
    assert!(parse(&both).unwrap_err().to_string().contains("'images/a.jpg' is listed for training and"));
}

#[test]
fn angles_need_a_size() {
    let mut asked = Vec::new();
    let set = read_transforms_bytes("transforms.json", NERF.as_bytes(), &mut |name| {
        asked.push(name.to_owned());
        Some((640, 480))
    });
    let set = set.unwrap();
    assert_eq!(asked, ["./train/r_0"]);
    let camera = &set.cameras[0];
    // A right angle: half the width away.
    assert_eq!((camera.width, camera.height), (640, 480));
    assert!((camera.fx - 320.0).abs() < 1e-3 && camera.fx == camera.fy);
    let both = NERF
        .replace("\"frames\"", "\"camera_angle_y\": 0.9272952180016122, \"w\": 640, \"h\": 480, \"frames\"");
    let camera = parse(&both).unwrap().cameras.remove(0);
    assert!((camera.fx - 320.0).abs() < 1e-3 && (camera.fy - 480.0).abs() < 1e-2, "{camera:?}");
    let message = parse(NERF).unwrap_err().to_string();
    assert!(
        message.starts_with("transforms.json: frame 0 ('./train/r_0'): the file has no 'w' and 'h'"),
        "{message}"
    );
}

#[test]
fn errors_name_the_frame_and_the_field() {
    let cases = [
        ("\"OPENCV\"", "\"OPENCV_FISHEYE\"", "camera_model OPENCV_FISHEYE is not supported"),
        ("\"k2\": 0", "\"k2\": 0.01", "camera_model OPENCV with distortion (k2 = 0.01)"),
        ("\"k2\": 0", "\"is_fisheye\": true", "fisheye"),
        ("\"k2\": 0", "\"distortion_params\": [0, 0.5]", "distortion_params"),
        ("\"colmap_im_id\": 3", "\"k1\": 1", "k1 = 1"),
        ("\"w\": 800", "\"w\": 800.5", "'w' is 800.5"),
        ("\"w\": 800", "\"w\": 99999", "width"),
        ("\"w\": 800", "\"w\": \"wide\"", "field 'w'"),
        ("\"w\": 800,", "", "no 'w' and 'h'"),
        ("\"fl_x\": 700.5", "\"fl_x\": -1", "fx"),
        ("\"fl_x\": 700.5,", "", "neither 'fl_x' nor 'camera_angle_x'"),
        ("\"fl_x\": 700.5", "\"camera_angle_x\": 3.2", "camera_angle_x"),
        ("[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], ", "[1, 0, 0, 1], ", "transform_matrix"),
        ("[[1, 0, 0, 1]", "[[2, 0, 0, 1]", "rotation"),
        ("[[1, 0, 0, 1]", "[[1, 0, 0]", "transform_matrix"),
        ("[[1, 0, 0, 1]", "[[0, 0, 0, 0], [1, 0, 0, 1]", "transform_matrix"),
        ("[0, 0, 0, 1]]}", "[0, 0, 1, 1]]}", "transform_matrix"),
        ("\"file_path\": \"./images/a.jpg\",", "", "file_path"),
    ];
    for (from, to, field) in cases {
        let bad = NERFSTUDIO.replacen(from, to, 1);
        assert_ne!(bad, NERFSTUDIO, "{from}");
        let message = parse(&bad).unwrap_err().to_string();
        assert!(message.starts_with("transforms.json: ") && message.contains(field), "{message}");
    }
    for text in
        ["", "[]", "{}", "{\"frames\": 1}", "{\"frames\": [{}]}", "{\"frames\": []} x", "{\"frames\": [1]}"]
    {
        assert!(matches!(parse(text), Err(Error::Codec(lexisplat::Error::Format { .. }))), "{text}");
    }
    assert!(parse("{\"frames\": []}").unwrap().cameras.is_empty());
}

#[test]
fn every_truncation_is_an_error() {
    for end in 0..NERFSTUDIO.len() {
        assert!(parse(&NERFSTUDIO[..end]).is_err(), "{end}");
    }
}

#[test]
fn damage_is_refused_or_gives_valid_cameras() {
    let mut state = 0x9E37_79B9_7F4A_7C15_u64;
    let mut random = move || {
        // Marsaglia's xorshift64.
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state
    };
    let (mut refused, mut accepted) = (0, 0);
    for round in 0..4000 {
        let mut bytes = [NERFSTUDIO, NERF][round % 2].as_bytes().to_vec();
        for _ in 0..=random() % 3 {
            let at = usize::try_from(random() % bytes.len() as u64).unwrap();
            match random() % 3 {
                0 => bytes[at] ^= 1 << (random() % 8),
                1 => bytes[at] = b"0123456789.-eE[]{},:\"x "[usize::try_from(random() % 23).unwrap()],
                _ => drop(bytes.remove(at)),
            }
        }
        match read_transforms_bytes("transforms.json", &bytes, &mut |_| Some((64, 48))) {
            Ok(set) => {
                accepted += 1;
                set.cameras.iter().for_each(|camera| camera.validate().unwrap());
            }
            Err(error) => {
                refused += 1;
                assert!(error.to_string().starts_with("transforms.json: "), "{error}");
            }
        }
    }
    assert!(refused > 500 && accepted > 500, "{refused} {accepted}");
}
