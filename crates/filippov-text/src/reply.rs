//! What a page is told of a text: the model, or what was not read.

use filippov_web::pack;
use serde_json::json;

use crate::module::read;

/// The reply to a text, as those of [`filippov_web::answer`] without arrays: `model` has the bytes of the model in base64, with the
/// section of a page; a failure has `error`, `line` and `column`.
pub fn reply(source: &str) -> Vec<u8> {
    let header = match read(source) {
        Ok(found) => {
            let n = found.system.definition.field.len();
            let name = match found.is_system {
                true => "object",
                false => "function",
            };
            let page = json!({
                "title": found.name,
                name: found.name,
                "y0": found.y0.unwrap_or_else(|| vec![1.0; n]),
                "t_span": found.t_span.unwrap_or_else(|| vec![0.0, 20.0]),
                "text": source,
            });
            match pack(&found.system.to_bytes(), &page.to_string()) {
                Ok(bytes) => {
                    json!({"ok": true, "kind": "read", "model": base64(&bytes), "arrays": {}})
                }
                Err(refusal) => failure(&refusal.text, 1, 1),
            }
        }
        Err(unreadable) => failure(&unreadable.error, unreadable.line, unreadable.column),
    };
    let text = header.to_string();
    let mut bytes = (text.len() as u32).to_le_bytes().to_vec();
    bytes.extend(text.as_bytes());
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

fn failure(error: &str, line: usize, column: usize) -> serde_json::Value {
    json!({"ok": false, "code": "text", "error": error, "line": line, "column": column, "arrays": {}})
}

const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

fn base64(bytes: &[u8]) -> String {
    let mut text = String::with_capacity(4 * bytes.len().div_ceil(3));
    for chunk in bytes.chunks(3) {
        let byte = |k: usize| u32::from(chunk.get(k).copied().unwrap_or(0));
        let bits = byte(0) << 16 | byte(1) << 8 | byte(2);
        for k in 0..4 {
            let letter = LETTERS[(bits >> (18 - 6 * k)) as usize & 63];
            text.push(if k <= chunk.len() {
                char::from(letter)
            } else {
                '='
            });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn base64_of_the_standard() {
        for (bytes, text) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
        ] {
            assert_eq!(super::base64(bytes.as_bytes()), text);
        }
    }
}
