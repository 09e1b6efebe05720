//! Tests `--config`: options of servers and nodes in a file.

use std::path::Path;

use crate::process::{Ended, Process, dcd, playground, token};

fn serve(config: &Path, more: &[&str]) -> Process {
    Process::start(dcd(&["serve", "--config"]).arg(config).args(more))
}

#[test]
fn a_server_and_a_node_take_their_options_from_files_and_the_command_line_wins() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let data = folder.path().join("data");
    let config = file(
        "server.toml",
        &format!(
            "scene = {:?}\nlisten = \"192.0.2.1:1\"\ndata = {data:?}\nnodes = 1\nregions = 3\nticks = 20\nnear = 20\nfar = 40.5\n\
             unpaced = true\njson = true\nkeep-avatars = \"2h\"\n",
            playground()
        ),
    );
    // The file's values would fail: the address cannot be listened on, and `regions` excludes `--cut`.
    let mut server = serve(&config, &["--listen", "127.0.0.1:0", "--cut", "x=0"]);
    let address = server.line("listening ");
    let config = file(
        "node.toml",
        &format!(
            "server = [{address:?}]\nthreads = 1\njson = true\nverbose = 1\nlog-format = \"json\"\ntoken = \"none\"\nmetrics = \"127.0.0.1:0\"\n"
        ),
    );
    let minted = file("token", &token(&data, "node"));
    let mut node =
        dcd(&["node", "--token-file", minted.to_str().unwrap(), "--config", config.to_str().unwrap()]);
    let mut node = Process::start(&mut node);
    node.line("metrics http://127.0.0.1:");
    let ended = node.end();
    assert_eq!((ended.code(), &ended.json()["tick"]), (Some(0), &20.into()), "{ended:?}");
    assert!(ended.errors.starts_with('{'), "its log is JSON, and says what is done: {ended:?}");
    let ended = server.end();
    assert_eq!((ended.code(), &ended.json()["regions"]), (Some(0), &2.into()), "{ended:?}");
}

#[test]
fn what_is_wrong_in_a_file_of_options_is_named_with_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("wrong.toml");
    let refused = |text: &str| -> Ended {
        std::fs::write(&path, text).unwrap();
        let ended = serve(&path, &["tower", "--data", "/nowhere"]).end();
        assert_eq!(ended.code(), Some(2), "{ended:?}");
        assert!(ended.errors.contains("wrong.toml: ") && !ended.errors.contains("secret"), "{ended:?}");
        ended
    };
    for (text, said) in [
        ("lisen = \"x\"", "`lisen` is no option of `dcd serve` (did you mean `listen`?)"),
        ("config = \"more.toml\"", "`config` is no option"),
        ("help = true", "`help` is no option"),
        ("state-every = 0", "invalid value '0' for '--state-every"),
        ("keep-avatars = 5", "write a time with its unit"),
        ("unpaced = \"yes\"", "`unpaced` wants true or false, and has a value of the type string"),
        ("fresh = true", "`fresh` would begin the world anew each time"),
        ("fresh = false", "take it out"),
        ("listen = [\"a\", \"b\"]", "`listen` wants a text or a number"),
        ("nodes = 1\nlisten dcd1-secret", "line 2: "),
        ("nodes = [\"dcd1-secret\"]", "`nodes` wants"),
    ] {
        let ended = refused(text);
        assert!(ended.errors.contains(said), "{text}: {ended:?}");
    }
    let swapped = Process::start(&mut dcd(&["node", "--token-file", "dcd1-secret"])).end();
    assert!(swapped.errors.contains("by --token") && !swapped.errors.contains("secret"), "{swapped:?}");
    let missing = serve(Path::new("none.toml"), &["tower"]).end();
    assert!(missing.code() == Some(2) && missing.errors.contains("none.toml: No such file"), "{missing:?}");
}
