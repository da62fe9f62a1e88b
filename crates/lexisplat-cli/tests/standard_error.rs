//! Standard error of commands that succeed.

use crate::folder::{Folder, lexisplat};

/// Drivers print to standard error on machines without a desktop. Nothing of that reaches the user.
#[test]
fn commands_without_a_window_are_silent_without_a_desktop() {
    let folder = Folder::few();
    for arguments in [
        &["devices"][..],
        &["devices", "--json"],
        &["render", "scene.ply", "-o", "pictures", "--orbit", "1", "--width", "32", "-q"],
        // A command that takes over 10 s says so.
        &["compress", "scene.ply", "--json", "-q"],
        &["compress", "scene.ply", "-o", "by-adapter.lexi", "--device", "auto", "-q"],
        &["compare", "scene.ply", "scene.lexi", "--orbit", "1", "--width", "32", "--json"],
    ] {
        let mut command = lexisplat();
        for name in ["XDG_RUNTIME_DIR", "DISPLAY", "WAYLAND_DISPLAY"] {
            command.env_remove(name);
        }
        let output = command.current_dir(folder.0.path()).args(arguments).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success() && error.is_empty(), "{arguments:?}: {error}");
    }
}
