//! The attribute `#[entered]` for entry points of the extension. Their bodies run inside `errors::caught`, where a panic becomes an
//! `InternalError`.

mod arguments;

use proc_macro2::TokenStream;
use quote::quote;
use syn::{
    Attribute, Block, FnArg, GenericArgument, Ident, ImplItem, Item, ItemConst, PathArguments, ReturnType, Signature, Stmt, Type,
    parse_quote,
};

/// Runs the body of this function inside `errors::caught`. On an `impl`, this applies to every function.
///
/// The attribute must precede `#[pymethods]` and `#[pyfunction]`, so that pyo3 receives the changed functions. A function that returns `T`
/// is changed to return `PyResult<T>`.
///
/// The body of a function that returns `Result<T, Failure>` runs inside `errors::entry`, which converts its errors. In this body, `py` is the
/// token of the interpreter, and `NAME` the name of the function in messages. It is `Class` for a constructor, and else `Class.method` or
/// `function`. A body that starts with its own constant `NAME` replaces this name.
///
/// `#[arguments(a, b=None, *, c=false)]` on a function lists the arguments that Python passes: see the module `arguments`.
#[proc_macro_attribute]
pub fn entered(_: proc_macro::TokenStream, item: proc_macro::TokenStream) -> proc_macro::TokenStream {
    expand(item.into()).unwrap_or_else(|error| error.to_compile_error()).into()
}

fn expand(item: TokenStream) -> syn::Result<TokenStream> {
    match syn::parse2(item)? {
        Item::Fn(mut function) => {
            let name = function.sig.ident.to_string();
            enter(&mut function.attrs, &mut function.sig, &mut function.block, &name)?;
            Ok(quote!(#function))
        }
        Item::Impl(mut methods) => {
            let class = match &*methods.self_ty {
                Type::Path(path) => path.path.segments.last().map(|segment| segment.ident.to_string()).unwrap_or_default(),
                _ => String::new(),
            };
            for item in &mut methods.items {
                if let ImplItem::Fn(method) = item {
                    let name = format!("{class}.{}", method.sig.ident);
                    enter(&mut method.attrs, &mut method.sig, &mut method.block, name.trim_end_matches(".new"))?;
                }
            }
            Ok(quote!(#methods))
        }
        other => Err(syn::Error::new_spanned(other, "entered: expected a function or an impl")),
    }
}

/// Change a function. `name` is its name in messages.
fn enter(attributes: &mut Vec<Attribute>, signature: &mut Signature, body: &mut Block, name: &str) -> syn::Result<()> {
    if let Some((value, failure)) = fallible(&signature.output) {
        let (constants, rest) = leading_constants(body);
        let named = constants.iter().any(|constant| constant.ident == "NAME");
        let default: Option<ItemConst> = (!named).then(|| parse_quote!(const NAME: &str = #name;));
        *body = parse_quote!({
            #(#constants)*
            #default
            crate::errors::entry(py, NAME, || -> Result<#value, #failure> { #(#rest)* })
        });
        signature.output = parse_quote!(-> ::pyo3::PyResult<#value>);
        pass_interpreter(signature);
    } else if is_result(&signature.output) {
        *body = parse_quote!({ crate::errors::caught(#name, move || #body) });
    } else {
        *body = parse_quote!({ crate::errors::caught(#name, move || ::pyo3::PyResult::Ok((move || #body)())) });
        signature.output = match &signature.output {
            ReturnType::Type(_, output) => parse_quote!(-> ::pyo3::PyResult<#output>),
            ReturnType::Default => parse_quote!(-> ::pyo3::PyResult<()>),
        };
    }
    arguments::add(attributes, signature, body, name)
}

/// Add the argument `py` to a function that does not declare it.
fn pass_interpreter(signature: &mut Signature) {
    let named = |input: &FnArg, names: &[&str]| arguments::named(input).is_some_and(|name| names.iter().any(|wanted| name == wanted));
    if signature.inputs.iter().any(|input| named(input, &["py"])) {
        return;
    }
    let has_object = signature.inputs.first().is_some_and(|first| matches!(first, FnArg::Receiver(_)) || named(first, &["slf", "cls"]));
    signature.inputs.insert(usize::from(has_object), parse_quote!(py: ::pyo3::Python<'py>));
    arguments::declare_lifetime(signature);
}

/// The constants at the start of a body, and its other statements.
fn leading_constants(body: &Block) -> (Vec<ItemConst>, Vec<Stmt>) {
    let mut rest = body.stmts.clone();
    let mut constants = Vec::new();
    while let Some(Stmt::Item(Item::Const(constant))) = rest.first() {
        constants.push(constant.clone());
        rest.remove(0);
    }
    (constants, rest)
}

/// The last segment of a type: its name and its arguments.
fn last_segment(output: &ReturnType) -> Option<(&Ident, &PathArguments)> {
    let ReturnType::Type(_, output) = output else { return None };
    // A type that a macro received as `$name:ty` is a group.
    let output = if let Type::Group(group) = &**output { &group.elem } else { output };
    let Type::Path(path) = &**output else { return None };
    path.path.segments.last().map(|segment| (&segment.ident, &segment.arguments))
}

fn is_result(output: &ReturnType) -> bool {
    last_segment(output).is_some_and(|(name, _)| name == "PyResult")
}

/// The types `T` and `Failure` of the output `Result<T, Failure>`.
fn fallible(output: &ReturnType) -> Option<(Type, Type)> {
    let (name, PathArguments::AngleBracketed(arguments)) = last_segment(output)? else { return None };
    let mut types = arguments.args.iter().filter_map(|argument| match argument {
        GenericArgument::Type(each) => Some(each.clone()),
        _ => None,
    });
    if name == "Result" { Some((types.next()?, types.next()?)) } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expanded(item: TokenStream) -> String {
        expand(item).expect("well formed").to_string().replace(' ', "")
    }

    #[test]
    fn every_method_of_an_impl_is_caught() {
        let text = expanded(quote! {
            impl Arm {
                #[getter]
                fn n(&self) -> usize { self.n }
                fn __len__(&self) -> PyResult<usize> { Ok(self.n) }
                fn reset(&self) { self.clear(); }
            }
        });
        assert!(text.contains(r#"fnn(&self)->::pyo3::PyResult<usize>{crate::errors::caught("Arm.n",move||"#), "{text}");
        assert!(text.contains(r#"fn__len__(&self)->PyResult<usize>{crate::errors::caught("Arm.__len__",move||{Ok(self.n)})}"#), "{text}");
        assert!(text.contains(r#"fnreset(&self)->::pyo3::PyResult<()>{crate::errors::caught("Arm.reset""#), "{text}");
    }

    #[test]
    fn failures_are_converted() {
        let text = expanded(quote! {
            impl Arm {
                #[new]
                fn new(x: &Bound<'_, PyAny>) -> Result<Self, Failure> { Ok(Arm { n: count(NAME, "x", x)? }) }
                fn scale(&self) -> Result<f64, Failure> {
                    const NAME: &str = "scale";
                    self.scaled(NAME)
                }
            }
        });
        let body = r#"{constNAME:&str="Arm";crate::errors::entry(py,NAME,||->Result<Self,Failure>{Ok(Arm{n:count(NAME,"x",x)?})})}"#;
        assert!(text.contains(&format!("fnnew<'py>(py:::pyo3::Python<'py>,x:&Bound<'_,PyAny>)->::pyo3::PyResult<Self>{body}")), "{text}");
        assert!(text.contains("fnscale<'py>(&self,py:::pyo3::Python<'py>)"), "{text}");
        assert!(
            text.contains(r#"{constNAME:&str="scale";crate::errors::entry(py,NAME,||->Result<f64,Failure>{self.scaled(NAME)})}"#),
            "{text}"
        );
    }

    #[test]
    fn arguments_of_any_type_need_no_declaration() {
        let text = expanded(quote! {
            impl Arm {
                #[arguments(q, frame=None, *, out=None, flag=false, scaled=true, kind="a", size=1.0)]
                fn pose(&self, scaled: bool, kind: &str, size: f64) -> PyResult<u8> { Ok(1) }
                #[new]
                #[arguments(q, out=None)]
                fn new() -> PyResult<u8> { Ok(1) }
                #[arguments(q)]
                fn __call__(&self) -> PyResult<u8> { Ok(1) }
            }
        });
        assert!(text.contains(r#"signature=(q,frame=None,*surplus,out=None,flag=None,scaled=true,kind="a",size=1.0)"#), "{text}");
        let shown = r#"text_signature="($self, q, frame=None, *, out=None, flag=False, scaled=True, kind='a', size=1.0)""#;
        assert!(text.contains(&shown.replace(' ', "")), "{text}");
        let any = "::pyo3::Bound<'py,::pyo3::PyAny>";
        let surplus = "surplus:&::pyo3::Bound<'py,::pyo3::types::PyTuple>";
        let others = format!("{surplus},out:Option<&{any}>,flag:Option<&{any}>,scaled:bool,kind:&str,size:f64");
        assert!(text.contains(&format!("fnpose<'py>(&self,q:&{any},frame:Option<&{any}>,{others})")), "{text}");
        assert!(text.contains(r#"require_names(surplus,"Arm.pose",2usize,"out=,flag=,scaled=,kind=,size=")?;"#), "{text}");
        assert!(text.contains(r#"signature=(q,out=None),text_signature="(q,out=None)""#), "{text}");
        assert!(text.contains("signature=(q))]"), "{text}");
    }

    #[test]
    fn other_defaults_and_items_are_refused() {
        let refused = |item| expand(item).is_err();
        assert!(refused(quote!(
            #[arguments(x=[])]
            fn f() -> PyResult<u8> {
                Ok(1)
            }
        )));
        assert!(refused(quote!(
            #[pyo3(signature = (x, *, y=None))]
            fn f(x: u8, y: Option<u8>) -> PyResult<u8> {
                Ok(1)
            }
        )));
        assert!(refused(quote!(
            struct Arm;
        )));
    }
}
