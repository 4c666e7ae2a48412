//! The one-sentence errors for a missing display or graphics driver.

/// Checks that there is a display to open a window on; why there is none otherwise.
pub fn check() -> Result<(), String> {
    #[cfg(all(unix, not(target_os = "macos")))]
    {
        let named = |variable: &str| std::env::var(variable).ok().filter(|value| !value.is_empty());
        match named("DISPLAY") {
            None => {
                return Err("there is no display to open a window on (DISPLAY is not set)".to_owned());
            }
            Some(display) if !answers(&display) => {
                return Err(format!("no X server answers at DISPLAY={display}"));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

/// Whether something listens at an X display such as `:0`, `unix:0.0` or `host:10.0`.
///
/// A name of unknown form is left to the window system.
#[cfg(all(unix, not(target_os = "macos")))]
fn answers(display: &str) -> bool {
    let Some((host, screen)) = display.rsplit_once(':') else { return true };
    let Ok(number) = screen.split('.').next().unwrap_or_default().parse::<u16>() else { return true };
    if host.is_empty() || host == "unix" {
        let path = format!("/tmp/.X11-unix/X{number}");
        let by_file = std::os::unix::net::UnixStream::connect(&path).is_ok();
        return by_file || listens_abstractly(&path) || reaches("localhost", number);
    }
    reaches(host, number)
}

/// On Linux an X server may listen at a name outside of the file system only.
#[cfg(target_os = "linux")]
fn listens_abstractly(path: &str) -> bool {
    use std::os::linux::net::SocketAddrExt;
    use std::os::unix::net::{SocketAddr, UnixStream};

    SocketAddr::from_abstract_name(path).and_then(|address| UnixStream::connect_addr(&address)).is_ok()
}

#[cfg(all(unix, not(any(target_os = "macos", target_os = "linux"))))]
fn listens_abstractly(_path: &str) -> bool {
    false
}

#[cfg(all(unix, not(target_os = "macos")))]
fn reaches(host: &str, number: u16) -> bool {
    const FIRST_PORT: u16 = 6000;
    FIRST_PORT.checked_add(number).is_some_and(|port| std::net::TcpStream::connect((host, port)).is_ok())
}

/// Turns the panics with which Bevy meets a missing window system or graphics driver into one
/// sentence, which `explain` makes of the reason, and exit code 1. Only their messages distinguish them; all other panics
/// stay as they are.
pub fn explain_missing_hardware(explain: impl Fn(&str) -> String + Send + Sync + 'static) {
    const KNOWN: [(&str, &str); 3] = [
        ("Failed to build event loop", "the window system does not answer"),
        ("Unable to find a GPU", "there is no graphics driver (on Linux, a Vulkan driver) that Bevy can use"),
        ("Failed to create wgpu surface", "the graphics driver cannot draw on this display"),
    ];
    let previous = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let message = panic.payload_as_str().unwrap_or_default();
        if let Some((_, reason)) = KNOWN.iter().find(|(known, _)| message.contains(known)) {
            eprintln!("{}", explain(reason));
            std::process::exit(1);
        }
        previous(panic);
    }));
}
