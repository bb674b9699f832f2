//! The attribute `#[arguments(a, b=None, *, c=false)]`: the arguments that Python passes to an entry point.
//!
//! The list has the syntax of a signature in Python, and `help()` shows its defaults. An argument that the function does not declare is any
//! object: `&Bound<'py, PyAny>`, or `Option<&Bound<'py, PyAny>>` if it has a default. If the caller omits an argument of the type
//! `Option<..>`, it is `None`, and the default is only shown.
//!
//! If a caller passes too many arguments without a name, Python's own message does not mention that the others require their names. So the
//! signature has `*surplus` in the place of `*`, and the body starts with `errors::require_names`. It raises a `TypeError` with the names if
//! `surplus` is not empty.

use proc_macro2::TokenStream;
use quote::{ToTokens, quote};
use syn::parse::{Parse, ParseStream};
use syn::punctuated::Punctuated;
use syn::{Attribute, Block, Error, Expr, ExprLit, FnArg, GenericParam, Ident, Lit, Pat, Result, Signature, Token, Type, parse_quote};

/// A part of the list.
enum Part {
    /// `*`: the arguments after it require their names.
    Star,
    Argument {
        name: Ident,
        default: Option<Expr>,
    },
}

impl Parse for Part {
    fn parse(input: ParseStream) -> Result<Self> {
        if input.parse::<Option<Token![*]>>()?.is_some() {
            return Ok(Part::Star);
        }
        let name = input.parse()?;
        let default = if input.parse::<Option<Token![=]>>()?.is_some() { Some(input.parse()?) } else { None };
        Ok(Part::Argument { name, default })
    }
}

/// Replace the attribute by pyo3's signature, and add the arguments that the function does not declare. `name` is the name of the function
/// in messages.
pub fn add(attributes: &mut Vec<Attribute>, signature: &mut Signature, body: &mut Block, name: &str) -> Result<()> {
    if let Some(other) =
        attributes.iter().find(|attribute| attribute.path().is_ident("pyo3") && quote!(#attribute).to_string().contains("* ,"))
    {
        return Err(Error::new_spanned(other, "entered: expected #[arguments(..)] for a signature with *"));
    }
    let Some(at) = attributes.iter().position(|attribute| attribute.path().is_ident("arguments")) else { return Ok(()) };
    let parts = attributes.remove(at).parse_args_with(Punctuated::<Part, Token![,]>::parse_terminated)?;
    let mut declared: Vec<FnArg> = std::mem::take(&mut signature.inputs).into_iter().collect();
    let (mut passed, mut formal, mut text) = (Vec::<FnArg>::new(), Vec::new(), Vec::new());
    let (mut positional, mut keywords, mut star) = (0_usize, Vec::new(), false);
    for part in parts {
        let Part::Argument { name, default } = part else {
            star = true;
            passed.push(parse_quote!(surplus: &::pyo3::Bound<'py, ::pyo3::types::PyTuple>));
            formal.push(quote!(*surplus));
            text.push("*".to_string());
            continue;
        };
        let input = match declared.iter().position(|input| named(input).is_some_and(|named| *named == name)) {
            Some(i) => declared.remove(i),
            None if default.is_some() => parse_quote!(#name: Option<&::pyo3::Bound<'py, ::pyo3::PyAny>>),
            None => parse_quote!(#name: &::pyo3::Bound<'py, ::pyo3::PyAny>),
        };
        if star {
            keywords.push(format!("{name}="));
        } else {
            positional += 1;
        }
        text.push(default.as_ref().map_or_else(|| Ok(name.to_string()), |default| Ok::<_, Error>(format!("{name}={}", shown(default)?)))?);
        formal.push(match default {
            None => quote!(#name),
            Some(_) if optional(&input) => quote!(#name=None),
            Some(default) => quote!(#name=#default),
        });
        passed.push(input);
    }
    if star {
        let names = keywords.join(", ");
        *body = parse_quote!({ crate::errors::require_names(surplus, #name, #positional, #names)?; #body });
    }
    // Python has no text for the signature of a special method such as `__call__`.
    let text = (!signature.ident.to_string().starts_with("__")).then(|| {
        let text: Vec<String> = own(attributes, declared.first()).into_iter().chain(text).collect();
        let text = format!("({})", text.join(", "));
        quote!(, text_signature = #text)
    });
    attributes.push(parse_quote!(#[pyo3(signature = (#(#formal),*) #text)]));
    attributes.push(parse_quote!(#[allow(clippy::too_many_arguments)]));
    signature.inputs = declared.into_iter().chain(passed).collect();
    declare_lifetime(signature);
    Ok(())
}

/// Declare the lifetime `'py` of a function that uses it.
pub fn declare_lifetime(signature: &mut Signature) {
    let declares = |parameter: &GenericParam| matches!(parameter, GenericParam::Lifetime(lifetime) if lifetime.lifetime.ident == "py");
    if !signature.generics.params.iter().any(declares) {
        signature.generics.params.insert(0, parse_quote!('py));
    }
}

/// The text of the object or class in `text_signature`. `first` is the first argument that the function declares.
fn own(attributes: &[Attribute], first: Option<&FnArg>) -> Option<String> {
    let has = |name: &str| attributes.iter().any(|attribute| attribute.path().is_ident(name));
    if has("new") || has("staticmethod") {
        return None;
    }
    if has("classmethod") {
        return Some("$cls".into());
    }
    let first = first?;
    (matches!(first, FnArg::Receiver(_)) || named(first).is_some_and(|name| name == "slf")).then(|| "$self".into())
}

/// The name of an argument; `None` for `self`.
pub fn named(input: &FnArg) -> Option<&Ident> {
    match input {
        FnArg::Typed(typed) => match &*typed.pat {
            Pat::Ident(pattern) => Some(&pattern.ident),
            _ => None,
        },
        FnArg::Receiver(_) => None,
    }
}

fn optional(input: &FnArg) -> bool {
    let FnArg::Typed(typed) = input else { return false };
    matches!(&*typed.ty, Type::Path(path) if path.path.segments.last().is_some_and(|segment| segment.ident == "Option"))
}

/// A default as Python writes it.
fn shown(default: &Expr) -> Result<String> {
    match default {
        Expr::Path(path) if path.path.is_ident("None") => Ok("None".into()),
        Expr::Lit(ExprLit { lit: Lit::Bool(flag), .. }) => Ok(if flag.value { "True" } else { "False" }.into()),
        Expr::Lit(ExprLit { lit: Lit::Str(text), .. }) => Ok(format!("'{}'", text.value())),
        Expr::Lit(ExprLit { lit: lit @ (Lit::Int(_) | Lit::Float(_)), .. }) => Ok(TokenStream::to_string(&lit.to_token_stream())),
        _ => Err(Error::new_spanned(default, "arguments: expected a default that is None, a flag, a number or a text")),
    }
}
