//! `kill -9` at any moment.

use lexisplat_testing::Random;

use super::runs::{JOBS, OLD, OUTPUT, assert_old_or_new, program, ready, undisturbed};

/// Kills of each job, with and without an output to replace.
const KILLS: usize = 4;
/// How much later than the last moment of an undisturbed run a kill may come.
const SLACK: f64 = 1.1;

#[test]
fn killed_runs_leave_the_output_as_it_was_or_whole() {
    let folder = ready();
    let before = folder.names();
    let mut random = Random::new(6);
    let mut killed = 0;
    for job in JOBS {
        let (whole, duration) = undisturbed(&folder, job);
        for old in [None, Some(OLD)] {
            for _ in 0..KILLS {
                let _ = std::fs::remove_file(folder.path(OUTPUT));
                let mut arguments = job.to_vec();
                if let Some(old) = old {
                    std::fs::write(folder.path(OUTPUT), old).unwrap();
                    arguments.push("--overwrite");
                }
                let mut child = program(&folder, &arguments).spawn().unwrap();
                std::thread::sleep(duration.mul_f64(SLACK * f64::from(random.unit())));
                child.kill().unwrap();
                let ended = child.wait().unwrap();
                killed += usize::from(!ended.success());
                let new = assert_old_or_new(&folder, &before, old, &whole);
                assert!(new || !ended.success(), "{job:?} said it was done");
            }
        }
        let _ = std::fs::remove_file(folder.path(OUTPUT));
    }
    assert!(killed > 0, "every run was done before it was killed");
}
