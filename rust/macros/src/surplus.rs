//! Arguments without a name beyond the last positional one. Python's own message does not mention that the others require their names.
//!
//! The attribute `#[pyo3(signature = (a, b, *, c=None))]` becomes `(a, b, *surplus, c=None)`. The function has an additional argument
//! `surplus`, and its body starts with `errors::require_names`, which raises a `TypeError` with the names if `surplus` is not empty.

use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};
use quote::quote;
use syn::{Attribute, Block, FnArg, Meta, Pat, Signature, parse_quote};

/// Change a function whose signature has keyword-only arguments. `name` is the name of the function in messages.
pub fn name_the_others(attributes: &mut Vec<Attribute>, signature: &mut Signature, body: &mut Block, name: &str) -> syn::Result<()> {
    let own = own_argument(attributes, signature);
    // Python has no text for the signature of a special method such as `__call__`.
    let shown = !signature.ident.to_string().starts_with("__");
    let Some((positional, keywords)) = attributes.iter_mut().find_map(|attribute| change(attribute, own, shown)) else { return Ok(()) };
    let place =
        |wanted: Option<&String>| wanted.and_then(|wanted| signature.inputs.iter().position(|input| named(input).as_ref() == Some(wanted)));
    let at = if positional.is_empty() { place(keywords.first()) } else { place(positional.last()).map(|i| i + 1) };
    let at = at.ok_or_else(|| syn::Error::new_spanned(&signature.ident, "entered: expected arguments with the names of the signature"))?;
    signature.inputs.insert(at, parse_quote!(surplus: &::pyo3::Bound<'_, ::pyo3::types::PyTuple>));
    let (most, names) = (positional.len(), keywords.iter().map(|each| format!("{each}=")).collect::<Vec<_>>().join(", "));
    *body = parse_quote!({ crate::errors::require_names(surplus, #name, #most, #names)?; #body });
    attributes.push(parse_quote!(#[allow(clippy::too_many_arguments)]));
    Ok(())
}

/// The text of the object or class in `text_signature`.
fn own_argument(attributes: &[Attribute], signature: &Signature) -> Option<&'static str> {
    let has = |name: &str| attributes.iter().any(|attribute| attribute.path().is_ident(name));
    if has("new") || has("staticmethod") {
        return None;
    }
    if has("classmethod") {
        return Some("$cls");
    }
    let first = signature.inputs.first()?;
    (matches!(first, FnArg::Receiver(_)) || named(first).is_some_and(|name| name == "slf")).then_some("$self")
}

fn named(input: &FnArg) -> Option<String> {
    match input {
        FnArg::Typed(typed) => match &*typed.pat {
            Pat::Ident(pattern) => Some(pattern.ident.to_string()),
            _ => None,
        },
        FnArg::Receiver(_) => None,
    }
}

/// Change the signature in an attribute. Returns the names of its positional and of its keyword-only arguments, or `None` if it has no
/// keyword-only arguments. With `shown`, the attribute receives the `text_signature` of the original signature.
fn change(attribute: &mut Attribute, own: Option<&'static str>, shown: bool) -> Option<(Vec<String>, Vec<String>)> {
    let Meta::List(list) = &mut attribute.meta else { return None };
    if !list.path.is_ident("pyo3") {
        return None;
    }
    let mut tokens: Vec<TokenTree> = list.tokens.clone().into_iter().collect();
    let is = |token: &TokenTree, name: &str| matches!(token, TokenTree::Ident(ident) if ident == name);
    let at = tokens.iter().position(|token| is(token, "signature"))? + 2;
    let TokenTree::Group(group) = tokens.get(at)? else { return None };
    let parts = split(group.stream());
    let star = parts.iter().position(|part| matches!(part.as_slice(), [TokenTree::Punct(punct)] if punct.as_char() == '*'))?;
    let name = |part: &Vec<TokenTree>| match part.first() {
        Some(TokenTree::Ident(ident)) => Some(ident.to_string()),
        _ => None,
    };
    let positional: Vec<String> = parts[..star].iter().filter_map(name).collect();
    let keywords: Vec<String> = parts[star + 1..].iter().filter_map(name).collect();
    let has_text = tokens.iter().any(|token| is(token, "text_signature"));
    let text = own.map(str::to_string).into_iter().chain(parts.iter().map(|part| text_of(part))).collect::<Vec<_>>().join(", ");
    let changed = parts.iter().enumerate().map(|(i, part)| if i == star { quote!(*surplus) } else { part.iter().cloned().collect() });
    let changed: Vec<TokenStream> = changed.collect();
    tokens[at] = TokenTree::Group(Group::new(Delimiter::Parenthesis, quote!(#(#changed),*)));
    list.tokens = tokens.into_iter().collect();
    if shown && !has_text {
        let text = format!("({text})");
        list.tokens.extend(quote!(, text_signature = #text));
    }
    Some((positional, keywords))
}

/// The parts of a signature between its commas.
fn split(tokens: TokenStream) -> Vec<Vec<TokenTree>> {
    let mut parts: Vec<Vec<TokenTree>> = vec![Vec::new()];
    for token in tokens {
        match &token {
            TokenTree::Punct(comma) if comma.as_char() == ',' => parts.push(Vec::new()),
            _ => {
                if let Some(part) = parts.last_mut() {
                    part.push(token);
                }
            }
        }
    }
    parts.retain(|part| !part.is_empty());
    parts
}

/// An argument as Python's `inspect` shows it. A default other than a literal or `None` is `...`.
fn text_of(part: &[TokenTree]) -> String {
    let [name, equals, default @ ..] = part else { return part.iter().map(ToString::to_string).collect() };
    if equals.to_string() != "=" {
        return part.iter().map(ToString::to_string).collect();
    }
    let value = match default {
        [TokenTree::Ident(ident)] if ident == "true" => "True".to_string(),
        [TokenTree::Ident(ident)] if ident == "false" => "False".to_string(),
        [TokenTree::Ident(ident)] if ident == "None" => "None".to_string(),
        [TokenTree::Literal(literal)] => literal.to_string().replace('"', "'"),
        _ => "...".to_string(),
    };
    format!("{name}={value}")
}
