fn main() {
    let folder = std::env::args().nth(1).unwrap();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "py") {
            let text = std::fs::read_to_string(&path).unwrap();
            std::fs::write(path.with_extension("reply"), filippov_text::reply(&text)).unwrap();
        }
    }
}
