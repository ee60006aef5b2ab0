//! How names are compared: every spelling of a name is one canonical name, and an unknown name gets the nearest known one.

/// The canonical spelling, `snake_case`: `receiveShadows`, `ReceiveShadows` and `receive-shadows` are all `receive_shadows`.
///
/// A capital starts a word if it follows a small letter or a digit, or if it is the last of several and a small letter follows (`HTTPServer`
/// is `http_server`). Digits belong to the word before them. Anything that is no letter and no digit separates words.
pub fn canonical(name: &str) -> String {
    let mut result = String::with_capacity(name.len() + 4);
    let mut before: Option<char> = None;
    let mut letters = name.chars().peekable();
    while let Some(letter) = letters.next() {
        if !letter.is_alphanumeric() {
            before = None;
            continue;
        }
        let new_word = match before {
            None => true,
            Some(before) => {
                letter.is_uppercase() && (!before.is_uppercase() || letters.peek().is_some_and(|next| next.is_lowercase()))
            }
        };
        if new_word && !result.is_empty() {
            result.push('_');
        }
        result.extend(letter.to_lowercase());
        before = Some(letter);
    }
    result
}

/// The known name that is most like the given one, if any is alike at all.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let name = canonical(name);
    let words = |name: &str| {
        let mut words: Vec<String> = name.split('_').map(str::to_owned).collect();
        words.sort_unstable();
        words
    };
    let name_words = words(&name);
    let alike = |candidate: &str| {
        let candidate = canonical(candidate);
        if words(&candidate) == name_words {
            return Some(1.0);
        }
        let likeness = strsim::jaro_winkler(&name, &candidate);
        // Short names share their letters with any long one: half of the longer must be there, or all of the shorter in a row.
        let longer = name.chars().count().max(candidate.chars().count());
        let meant = || 2 * strsim::osa_distance(&name, &candidate) <= longer || name.len() > 2 && candidate.contains(&name);
        (likeness > 0.7 && meant()).then_some(likeness)
    };
    known
        .into_iter()
        .filter_map(|candidate| Some((alike(candidate)?, candidate)))
        .max_by(|(a, _), (b, _)| a.total_cmp(b))
        .map(|(_, candidate)| candidate)
}

/// The end of a message: the nearest name, or nothing.
pub(crate) fn hint<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, known).map(|nearest| format!("; did you mean `{nearest}`?")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spelling_is_one_name() {
        for (written, name) in [
            ("receiveShadows", "receive_shadows"),
            ("ReceiveShadows", "receive_shadows"),
            ("receive-shadows", "receive_shadows"),
            ("receive shadows", "receive_shadows"),
            ("RECEIVE_SHADOWS", "receive_shadows"),
            ("cutOffAngle2", "cut_off_angle2"),
            ("HTTPServer", "http_server"),
            ("LOD", "lod"),
            ("vec3Value", "vec3_value"),
            ("x", "x"),
            ("Größe", "größe"),
            ("", ""),
            ("__", ""),
        ] {
            assert_eq!(canonical(written), name, "{written}");
            assert_eq!(canonical(name), name, "canonical names stay as they are");
        }
    }

    #[test]
    fn a_typing_error_finds_its_name() {
        let known = ["translation", "rotation", "scale", "center", "route", "weak_route"];
        for (written, expected) in [
            ("transaltion", Some("translation")),
            ("Rotaton", Some("rotation")),
            ("centre", Some("center")),
            ("route_weak", Some("weak_route")),
            ("zzz", None),
            ("tan", None),
        ] {
            assert_eq!(nearest(written, known), expected, "{written}");
        }
    }
}
