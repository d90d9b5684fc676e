//! Changes to JSON that leave it JSON: numbers, keys, lists and whole subtrees.

use crate::random::Random;
use serde_json::{Map, Number, Value, json};

/// Deepest nesting that is made.
const DEEP: usize = 200;

/// Changes `value` at one place below it; `names` are keys and texts that the format knows.
pub fn change(random: &mut Random, value: &mut Value, names: &[&str]) {
    let count = count(value);
    let other = node(value, &mut random.below(count)).cloned();
    let mut at = random.below(count);
    let Some(place) = node_mut(value, &mut at) else { return };
    match place {
        Value::Number(_) | Value::Bool(_) | Value::Null if random.chance(85) => scalar(random, place),
        Value::String(text) if random.chance(70) => *text = string(random, text, names),
        Value::Array(list) if random.chance(75) => array(random, list, other),
        Value::Object(map) if random.chance(75) => object(random, map, names, other),
        place => *place = anything(random, names, other),
    }
}

/// Number of values in a tree, itself among them.
fn count(value: &Value) -> usize {
    1 + match value {
        Value::Array(list) => list.iter().map(count).sum(),
        Value::Object(map) => map.values().map(count).sum(),
        _ => 0,
    }
}

/// Value number `at` of a tree, in its order.
fn node<'a>(value: &'a Value, at: &mut usize) -> Option<&'a Value> {
    if *at == 0 {
        return Some(value);
    }
    *at -= 1;
    match value {
        Value::Array(list) => list.iter().find_map(|value| node(value, at)),
        Value::Object(map) => map.values().find_map(|value| node(value, at)),
        _ => None,
    }
}

fn node_mut<'a>(value: &'a mut Value, at: &mut usize) -> Option<&'a mut Value> {
    if *at == 0 {
        return Some(value);
    }
    *at -= 1;
    match value {
        Value::Array(list) => list.iter_mut().find_map(|value| node_mut(value, at)),
        Value::Object(map) => map.values_mut().find_map(|value| node_mut(value, at)),
        _ => None,
    }
}

/// A number that takes the place of another.
fn scalar(random: &mut Random, place: &mut Value) {
    let old = place.as_f64().unwrap_or(1.0);
    let real = |x: f64| Number::from_f64(x).map_or(Value::Null, Value::Number);
    *place = match random.below(16) {
        0 => json!(0),
        1 => json!(1),
        2 => json!(-1),
        3 => json!(random.below(12)),
        4 => json!(u32::MAX),
        5 => json!(1u64 << 32),
        6 => json!(u64::MAX),
        7 => json!(i64::MIN),
        8 => json!(1u64 << random.below(64)),
        9 => real(random.pick([1e308, -1e308, 5e-324, 0.5, 1e20, -1e-40, 3.5e38])),
        10 => real(old + 1.0),
        11 => real(old - 1.0),
        12 => real(old * random.pick([2.0, -1.0, 0.5, 1e6, 256.0])),
        13 => match place.as_u64() {
            Some(whole) => json!(whole.wrapping_add(random.pick([1, u64::MAX, 4, 12, 255]))),
            None => Value::Bool(random.chance(50)),
        },
        14 => json!(random.pick(["5", "", "NaN", "true"])),
        _ => Value::Null,
    };
}

fn string(random: &mut Random, old: &str, names: &[&str]) -> String {
    match random.below(9) {
        0 => String::new(),
        1 => "a".repeat(1 << random.below(13)),
        2 => old.chars().rev().collect(),
        3 => format!("../{old}"),
        4 => format!("{old}\u{0}\n\u{7}%00é"),
        5 => old.chars().skip(random.below(old.len() + 1)).collect(),
        6 => random
            .pick(["data:,", "data:;base64,AAA", "http://a/b", "file:///dev/zero", ".", "/", "a?b#c", "%ff"])
            .into(),
        _ => random.pick_from(names).map_or_else(String::new, |name| (*name).to_owned()),
    }
}

fn array(random: &mut Random, list: &mut Vec<Value>, other: Option<Value>) {
    let at = random.below(list.len());
    match random.below(6) {
        0 if !list.is_empty() => {
            list.remove(at);
        }
        1 | 2 if !list.is_empty() => {
            let copy = list[at].clone();
            list.insert(at, copy);
        }
        3 => list.extend(other),
        4 => list.clear(),
        5 if !list.is_empty() && list.len() <= 64 => {
            let copies = random.within(2, 8);
            *list = (0..copies).flat_map(|_| list.clone()).collect();
        }
        _ => list.reverse(),
    }
}

fn object(random: &mut Random, map: &mut Map<String, Value>, names: &[&str], other: Option<Value>) {
    let at = random.below(map.len());
    let key = map.keys().nth(at).cloned();
    match (random.below(5), key) {
        (0 | 1, Some(key)) => {
            map.remove(&key);
        }
        (2, Some(key)) => {
            let value = map.remove(&key).unwrap_or_default();
            let name = random.pick_from(names).map_or(key, |name| (*name).to_owned());
            map.insert(name, value);
        }
        _ => {
            let name = random.pick_from(names).map_or_else(String::new, |name| (*name).to_owned());
            let value = anything(random, names, other);
            map.insert(name, value);
        }
    }
}

/// A value that takes the place of any.
fn anything(random: &mut Random, names: &[&str], other: Option<Value>) -> Value {
    match random.below(9) {
        0 => Value::Null,
        1 => json!([]),
        2 => json!({}),
        3 => json!(random.pick_from(names)),
        4 if random.chance(20) => (0..random.below(DEEP)).fold(json!(0), |inner, _| json!([inner])),
        4 | 5 => {
            let mut number = json!(1);
            scalar(random, &mut number);
            number
        }
        6 => json!([0, 1, 2]),
        _ => other.unwrap_or_default(),
    }
}
