//! Views of made-up folders, and with the data folder those of a real scene.

use std::fs;
use std::path::{Path, PathBuf};

use lexisplat::{Geometry, ply};
use lexisplat_render::{Image, RenderOptions, Scene, Split, orbit, render, squared_error};
use tempfile::TempDir;

use super::*;
use crate::decibels;

/// A folder with a COLMAP text model of these images, all of one camera of 32 x 24 pixels.
fn colmap(images: &[&str]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut text = String::new();
    for (number, name) in images.iter().enumerate() {
        text += &format!("{number} 1 0 0 0 {number} 0 4 1 {name}\n\n");
    }
    write(folder.path(), "sparse/0/cameras.txt", b"1 PINHOLE 32 24 40 36 16 12\n");
    write(folder.path(), "sparse/0/images.txt", text.as_bytes());
    folder
}

fn write(root: &Path, file: &str, bytes: &[u8]) {
    let path = root.join(file);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, bytes).unwrap();
}

/// Photos of this size, as PNG or JPEG by their endings.
fn photos(root: &Path, files: &[&str], (width, height): (u32, u32)) {
    for file in files {
        let path = root.join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let picture = image::RgbImage::from_fn(width, height, |x, y| {
            image::Rgb([x, y, x * y].map(|v| u8::try_from(v * 7 % 256).unwrap()))
        });
        picture.save(path).unwrap();
    }
}

fn options(root: &Path, images: &str) -> ViewOptions {
    let images = Some(root.join(images));
    ViewOptions { cameras: Some(root.to_path_buf()), images, ..ViewOptions::default() }
}

fn found(options: &ViewOptions) -> Result<ChosenViews> {
    find_views(options, &Geometry::default())
}

/// Names of the cameras with their photos' paths in `root`.
fn pairs(chosen: &ChosenViews, root: &Path) -> Vec<(String, String)> {
    let within = |path: &PathBuf| path.strip_prefix(root).unwrap().display().to_string();
    chosen
        .views
        .iter()
        .map(|v| (v.camera.name.clone(), v.photo.as_ref().map_or(String::new(), within)))
        .collect()
}

#[test]
fn photos_match_by_path_then_by_name() {
    let folder = colmap(&[
        "left/1.JPG",
        "right/1.JPG",
        "deep/er/2.jpg",
        "./3",
        "4.0001",
        "5.jpg",
        "gone.jpg",
        "6.png",
    ]);
    let root = folder.path();
    let files = [
        "images/left/1.png",
        "images/right/1.PNG",
        "images/er/2.jpeg",
        "images/3.jpg",
        "images/4.0001.png",
        "images/a/5.png",
        "images/a/6.png",
        "images/b/6.png",
        "images/b/other.png",
    ];
    photos(root, &files, (32, 24));
    photos(root, &["images/5.JPG"], (32, 24));
    write(root, "images/.5.jpg", b"no photo");
    write(root, "images/5.txt", b"no photo");
    let chosen = found(&options(root, "images")).unwrap();
    let expected = [
        ("./3", "images/3.jpg"),
        ("4.0001", "images/4.0001.png"),
        ("5.jpg", "images/5.JPG"),
        ("deep/er/2.jpg", "images/er/2.jpeg"),
        ("left/1.JPG", "images/left/1.png"),
        ("right/1.JPG", "images/right/1.PNG"),
    ];
    assert_eq!(pairs(&chosen, root), expected.map(|(a, b)| (a.to_owned(), b.to_owned())));
    assert_eq!(chosen.warnings.len(), 2, "{:?}", chosen.warnings);
    assert!(
        chosen.warnings[0].starts_with("1 of 8 cameras have no photo in ")
            && chosen.warnings[0].ends_with("such as 'gone.jpg'")
    );
    assert!(
        chosen.warnings[1].starts_with("1 of 8 cameras match several photos in "),
        "{:?}",
        chosen.warnings
    );
    assert_eq!(chosen.from, root.display().to_string());
    // The data set's folder means the same.
    assert_eq!(pairs(&found(&options(root, ".")).unwrap(), &root.join(".")).len(), 6);
}

#[test]
fn endings_tell_photos_of_one_name_apart() {
    let folder = colmap(&["a.JPEG", "b"]);
    photos(folder.path(), &["p/a.png", "p/a.jpeg", "p/b.png", "p/b.jpg"], (32, 24));
    let chosen = found(&options(folder.path(), "p")).unwrap();
    assert_eq!(pairs(&chosen, folder.path()), [("a.JPEG".to_owned(), "p/a.jpeg".to_owned())]);
    assert!(chosen.warnings[0].contains("'b': "), "{:?}", chosen.warnings);
}

#[test]
fn a_photo_belongs_to_one_camera() {
    // As with the test photos only of a scene whose training photos have the same names.
    let folder = colmap(&["train/r_0", "test/r_0", "test/r_1"]);
    photos(folder.path(), &["test/r_0.png", "test/r_1.png", "train/r_0.png"], (32, 24));
    let chosen = found(&options(folder.path(), "test")).unwrap();
    assert_eq!(pairs(&chosen, folder.path()), [("test/r_1".to_owned(), "test/r_1.png".to_owned())]);
    assert!(
        chosen.warnings[0].starts_with("2 of 3 cameras match a photo that another"),
        "{:?}",
        chosen.warnings
    );
    assert_eq!(found(&options(folder.path(), "")).unwrap().views.len(), 3);
}

#[test]
fn no_photo_at_all_is_an_error_with_both_names() {
    let folder = colmap(&["a.jpg", "b.jpg"]);
    let root = folder.path();
    photos(root, &["images/x/c.png"], (32, 24));
    let message = found(&options(root, "images")).unwrap_err().to_string();
    assert!(message.contains("a camera is 'a.jpg', a photo 'x/c.png'"), "{message}");
    fs::create_dir(root.join("empty")).unwrap();
    let message = found(&options(root, "empty")).unwrap_err().to_string();
    assert!(message.starts_with("images = ") && message.contains("empty: a folder with photos"), "{message}");
    assert!(matches!(found(&options(root, "missing")), Err(Error::Io { .. })));
    let alone = ViewOptions { cameras: None, ..options(root, "images") };
    assert!(matches!(found(&alone), Err(Error::Parameter { name: "images", .. })));
}

#[test]
fn resolutions_choose_folders_or_scale() {
    let folder = colmap(&["a.jpg"]);
    let root = folder.path();
    photos(root, &["images/a.png"], (32, 24));
    photos(root, &["images_4/a.png"], (8, 6));
    let size = |resolution, max_width| {
        let chosen =
            found(&ViewOptions { resolution, max_width, ..options(root, "images") }).unwrap().views.remove(0);
        let camera = &chosen.camera;
        assert!((camera.fx - 40.0 * camera.width as f32 / 32.0).abs() < 1e-4);
        assert!((camera.fy - 36.0 * camera.height as f32 / 24.0).abs() < 1e-4);
        let picture = photo(&chosen, [0.0; 3]).unwrap();
        assert_eq!((picture.width, picture.height), (camera.width, camera.height));
        let folder = chosen.photo.unwrap().parent().unwrap().file_name().unwrap().to_owned();
        (camera.width, camera.height, folder.into_string().unwrap())
    };
    assert_eq!(size(None, 1600), (32, 24, "images".into()));
    assert_eq!(size(Some(1), 1600), (32, 24, "images".into()));
    assert_eq!(size(Some(2), 1600), (16, 12, "images".into()));
    assert_eq!(size(Some(4), 1600), (8, 6, "images_4".into()));
    assert_eq!(size(Some(8), 1600), (4, 3, "images".into()));
    assert_eq!(size(None, 20), (20, 15, "images".into()));
    for resolution in [0, 3, 16] {
        let bad = ViewOptions { resolution: Some(resolution), ..options(root, "images") };
        assert!(matches!(found(&bad), Err(Error::Parameter { name: "resolution", .. })));
    }
    // Without photos the cameras themselves.
    let alone = ViewOptions { images: None, resolution: Some(2), ..options(root, "") };
    let view = found(&alone).unwrap().views.remove(0);
    assert_eq!((view.camera.width, view.camera.height, &view.photo), (16, 12, &None));
    assert!(matches!(photo(&view, [0.0; 3]), Err(Error::Parameter { .. })));
    // Of another shape.
    photos(root, &["images/a.png"], (24, 32));
    let message = found(&options(root, "images")).unwrap_err().to_string();
    assert!(message.contains("a.png: is 24 x 32 pixels") && message.contains("'a.jpg'"), "{message}");
}

#[test]
fn photos_are_read_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let camera = Camera { name: "a".into(), ..orbit(&Geometry::default(), 1, 2, 1).remove(0) };
    let view = View { camera, photo: Some(path.clone()) };
    image::RgbImage::from_raw(2, 1, vec![0, 128, 255, 1, 2, 3]).unwrap().save(&path).unwrap();
    let read = photo(&view, [1.0; 3]).unwrap();
    assert_eq!(read, Image::from_8bit(2, 1, &[[0, 128, 255], [1, 2, 3]]).unwrap());
    // Half and fully transparent, before a background.
    image::RgbaImage::from_raw(2, 1, vec![255, 0, 10, 51, 9, 9, 9, 0]).unwrap().save(&path).unwrap();
    let read = photo(&view, [0.0, 1.0, 0.5]).unwrap();
    assert_eq!(read.to_8bit(), [[51, 204, 104], [0, 255, 128]]);
    image::GrayImage::from_raw(4, 2, vec![100; 8]).unwrap().save(&path).unwrap();
    assert_eq!(photo(&view, [0.0; 3]).unwrap().to_8bit(), [[100; 3]; 2]);
    // A step in half the size: the kernel at 0.25, 0.75, 1.25 and 1.75 is 0.8672, 0.2266, -0.0703 and -0.0234,
    // two on either side, so 200 * (0.2266 - 0.0703 - 0.0234) / 2 = 13 and so on.
    let mut step = vec![0; 8];
    step.extend([200; 8]);
    image::GrayImage::from_raw(16, 1, step).unwrap().save(&path).unwrap();
    let wide = View { camera: Camera { width: 8, ..view.camera.clone() }, ..view.clone() };
    let row: Vec<u8> = photo(&wide, [0.0; 3]).unwrap().to_8bit().iter().map(|pixel| pixel[0]).collect();
    assert_eq!(row, [0, 0, 0, 13, 187, 202, 200, 200]);
}

#[test]
fn damaged_photos_are_refused() {
    let folder = colmap(&["a.jpg"]);
    let root = folder.path();
    for ending in ["png", "jpg"] {
        let name = format!("{ending}/a.{ending}");
        photos(root, &[&name], (32, 24));
        let bytes = fs::read(root.join(&name)).unwrap();
        let read = || photo(&found(&options(root, ending))?.views[0], [0.0; 3]);
        assert!(read().is_ok());
        // A PNG's last chunk is empty.
        for end in (0..bytes.len() - if ending == "png" { 12 } else { 0 }).step_by(5) {
            fs::write(root.join(&name), &bytes[..end]).unwrap();
            let error = read().unwrap_err();
            assert!(matches!(error, Error::Format { .. }), "{end}: {error}");
        }
        for at in (0..bytes.len()).step_by(5) {
            let mut flipped = bytes.clone();
            flipped[at] ^= 1 << (at % 8);
            fs::write(root.join(&name), &flipped).unwrap();
            drop(read());
        }
    }
    write(root, "png/a.png", b"\x89PNG\r\n\x1a\nrubbish");
    assert!(matches!(found(&options(root, "png")), Err(Error::Format { .. })));
    write(root, "png/a.png", b"rubbish");
    let message = found(&options(root, "png")).unwrap_err().to_string();
    assert!(message.contains("a.png: neither a PNG nor a JPEG"), "{message}");
    // A header that claims more than is allowed.
    let mut huge = Vec::new();
    let picture = image::GrayImage::new(1, 1);
    picture.write_to(&mut std::io::Cursor::new(&mut huge), image::ImageFormat::Png).unwrap();
    huge[16..20].copy_from_slice(&60_000_u32.to_be_bytes());
    let sum = crc32fast::hash(&huge[12..29]);
    huge[29..33].copy_from_slice(&sum.to_be_bytes());
    write(root, "png/a.png", &huge);
    let message = found(&options(root, "png")).unwrap_err().to_string();
    assert!(message.contains("over the limit of 16384 pixels"), "{message}");
}

#[test]
fn splits_come_before_photos_and_sizes_from_photos() {
    let names: Vec<String> = (0..20).map(|i| format!("{i:02}.png")).collect();
    let folder = colmap(&names.iter().map(String::as_str).collect::<Vec<_>>());
    let root = folder.path();
    let test = ViewOptions { split: SplitFilter::Test, images: None, ..options(root, "") };
    let tested = |options: &ViewOptions| {
        found(options).unwrap().views.into_iter().map(|view| view.camera.name).collect::<Vec<_>>()
    };
    assert_eq!(tested(&test), ["00.png", "08.png", "16.png"]);
    assert_eq!(tested(&ViewOptions { hold: 10, ..test.clone() }), ["00.png", "10.png"]);
    assert_eq!(tested(&ViewOptions { split: SplitFilter::Train, ..test.clone() }).len(), 17);
    photos(root, &["images/08.png", "images/09.png", "images/16.png"], (32, 24));
    let with_photos = ViewOptions { images: Some(root.join("images")), ..test };
    assert_eq!(tested(&with_photos), ["08.png", "16.png"]);
    let chosen = choose_views(Some(root), SplitFilter::Test, 0, 16, &Geometry::default()).unwrap();
    assert_eq!(chosen.iter().map(|c| (c.width, c.height)).collect::<Vec<_>>(), [(16, 12); 3]);

    // A NeRF folder says nothing about sizes.
    let nerf = tempfile::tempdir().unwrap();
    let text = |part: &str| {
        format!(
            r#"{{"camera_angle_x": 0.69, "frames": [{{"file_path": "./{part}/r_0",
                "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]}}]}}"#
        )
    };
    for part in ["train", "test"] {
        write(nerf.path(), &format!("transforms_{part}.json"), text(part).as_bytes());
    }
    let options = ViewOptions { cameras: Some(nerf.path().into()), ..ViewOptions::default() };
    let message = found(&options).unwrap_err().to_string();
    assert!(message.contains("name the folder of the photos"), "{message}");
    photos(nerf.path(), &["train/r_0.png", "test/r_0.png"], (20, 12));
    for images in [None, Some(nerf.path().to_path_buf())] {
        let chosen =
            found(&ViewOptions { split: SplitFilter::Test, images: images.clone(), ..options.clone() });
        let [view] = chosen.unwrap().views.try_into().unwrap();
        assert_eq!((view.camera.width, view.camera.height, view.camera.split), (20, 12, Some(Split::Test)));
        assert_eq!(view.photo, images.map(|folder| folder.join("test/r_0.png")));
    }
    write(nerf.path(), "train/r_0.png", b"rubbish");
    let message = found(&options).unwrap_err().to_string();
    assert!(message.contains("r_0.png: neither"), "{message}");
}

#[test]
fn generated_views_are_from_where_they_were_asked_for() {
    let mut geometry = Geometry::default();
    for i in 0..500_u16 {
        let at = |step: f32| (f32::from(i) * step).fract() * 2.0 - 1.0;
        geometry.positions.push([at(0.7549), at(0.5698), at(0.4302)]);
        geometry.opacities.push(2.0);
        geometry.scales.push([-3.0; 3]);
        geometry.rotations.push([1.0, 0.0, 0.0, 0.0]);
    }
    let make = |viewpoints| {
        let options = ViewOptions { viewpoints, count: 5, max_width: 480, ..ViewOptions::default() };
        find_views(&options, &geometry).unwrap()
    };
    let (auto, object, room) = (make(Viewpoints::Auto), make(Viewpoints::Object), make(Viewpoints::Room));
    assert_eq!((auto.from.as_str(), room.from.as_str()), ("orbit", "room"));
    assert_eq!(auto, object);
    assert_eq!((room.views.len(), room.views[4].camera.name.as_str()), (5, "room_004"));
    let wanted: Vec<Camera> = orbit(&geometry, 5, 960, 640).iter().map(|c| c.with_max_width(480)).collect();
    assert_eq!(object.views.into_iter().map(|v| v.camera).collect::<Vec<_>>(), wanted);
    assert_eq!(choose_views(None, SplitFilter::All, 5, 480, &geometry).unwrap(), wanted);
    assert!(choose_views(None, SplitFilter::Test, 5, 480, &geometry).is_err());
    assert!(choose_views(None, SplitFilter::All, 0, 480, &geometry).is_err());
    let none = ViewOptions { count: 0, ..ViewOptions::default() };
    assert!(find_views(&none, &geometry).is_err());
}

#[test]
fn bonsai_is_evaluated_as_the_field_does() {
    let [Some(model), cameras @ Some(_), images @ Some(_)] =
        ["bonsai-3dgs.ply", "bonsai-sparse", "bonsai-photos"].map(lexisplat_testing::real_data)
    else {
        return;
    };
    let splats = ply::read(&model, &ply::ReadOptions::default()).unwrap().splats;
    let options = ViewOptions { cameras, images, split: SplitFilter::Test, ..ViewOptions::default() };
    let chosen = find_views(&options, &splats.geometry).unwrap();
    assert_eq!((chosen.views.len(), chosen.warnings.len()), (13, 0), "{:?}", chosen.warnings);
    let mut sum = 0.0;
    for view in &chosen.views {
        let picture = render(&Scene::from(&splats), &view.camera, &RenderOptions::default()).unwrap();
        let photo = photo(view, [0.0; 3]).unwrap();
        let squares = squared_error(&picture, &photo).unwrap();
        sum += decibels(squares, photo.pixels.len() as u64).unwrap();
    }
    let mean = sum / 13.0;
    println!("bonsai-3dgs, COLMAP's cameras, 13 held-out photos: {mean:.3} dB");
    assert!((mean - 26.0).abs() < 0.1, "{mean}");
}

/// A data set comes from anybody, with links and pipes in it.
#[cfg(unix)]
#[test]
fn what_leads_out_of_a_data_set_is_not_read() {
    use std::os::unix::fs::symlink;

    let outside = tempfile::tempdir().unwrap();
    photos(outside.path(), &["private.png", "more/b.png"], (32, 24));
    let folder = colmap(&["a.png", "b.png"]);
    let root = folder.path();
    photos(root, &["images/a.png", "images/b.png"], (32, 24));
    assert_eq!(found(&options(root, "images")).unwrap().views.len(), 2);
    let refused = |link: &str, to: &Path| {
        symlink(to, root.join(link)).unwrap();
        let message = found(&options(root, "images")).unwrap_err().to_string();
        fs::remove_file(root.join(link)).unwrap();
        assert!(message.contains(link) && message.contains("leads out of the folder"), "{message}");
    };
    refused("images/c.png", &outside.path().join("private.png"));
    refused("images/more", &outside.path().join("more"));
    // Devices and pipes are no photos, wherever they are.
    symlink("/dev/zero", root.join("images/d.png")).unwrap();
    symlink("a.png", root.join("images/e.png")).unwrap();
    assert_eq!(found(&options(root, "images")).unwrap().views.len(), 2);
    // The photos that a file of cameras names.
    photos(root, &["beside.png"], (32, 24));
    symlink(outside.path().join("private.png"), root.join("link.png")).unwrap();
    assert_eq!(folder::beside(root, "beside"), Some(root.join("beside.png")));
    assert_eq!(folder::beside(root, "./beside.png"), Some(root.join("./beside.png")));
    let absolute = outside.path().join("private.png").display().to_string();
    for name in ["link", "link.png", "../private.png", &absolute, "/dev/zero", "images"] {
        assert_eq!(folder::beside(root, name), None, "{name}");
    }
    // The model itself.
    fs::rename(root.join("sparse/0/images.txt"), outside.path().join("images.txt")).unwrap();
    refused("sparse/0/images.txt", &outside.path().join("images.txt"));
}
