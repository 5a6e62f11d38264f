//! `report.html`: opens from disk, without a server and without anything from elsewhere.

use anyhow::Context;

/// The page; the numbers stand in it as JSON.
const PAGE: &str = include_str!("report.html");

/// Where they go.
const MARK: &str = "REPORT_JSON";

/// The page for what `metrics.json` holds.
pub fn html(json: &[u8]) -> anyhow::Result<Vec<u8>> {
    // In a script element only `<` could end it; JSON may write it as an escape.
    let json = std::str::from_utf8(json).context("metrics.json")?.replace('<', "\\u003c");
    let (before, after) = PAGE.split_once(MARK).context("report.html has no place for the numbers")?;
    Ok([before, &json, after].concat().into_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_can_leave_the_script_element() {
        let page = String::from_utf8(html(br#"{"scene": "</script><b>&"}"#).unwrap()).unwrap();
        assert!(page.contains(r#"{"scene": "\u003c/script>\u003cb>&"}"#));
        assert_eq!(page.matches("</script>").count(), PAGE.matches("</script>").count());
    }
}
