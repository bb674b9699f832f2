//! The attribute `#[entered]` for entry points of the extension. Their bodies run inside `errors::caught`, where a panic becomes an
//! `InternalError`.

mod surplus;

use proc_macro2::TokenStream;
use quote::quote;
use syn::{Block, Expr, ImplItem, Item, ReturnType, Signature, Stmt, Type, parse_quote};

/// Runs the body of this function inside `errors::caught`. On an `impl`, this applies to every function.
///
/// The attribute must precede `#[pymethods]` and `#[pyfunction]`, so that pyo3 receives the changed functions. A function that returns `T`
/// is changed to return `PyResult<T>`. A body that is one call of `errors::entry` is not changed.
///
/// A call with too many arguments without a name raises a `TypeError` that lists the keyword-only arguments.
#[proc_macro_attribute]
pub fn entered(_: proc_macro::TokenStream, item: proc_macro::TokenStream) -> proc_macro::TokenStream {
    expand(item.into()).unwrap_or_else(|error| error.to_compile_error()).into()
}

fn expand(item: TokenStream) -> syn::Result<TokenStream> {
    match syn::parse2(item)? {
        Item::Fn(mut function) => {
            let name = function.sig.ident.to_string();
            enter(&mut function.sig, &mut function.block, &name);
            surplus::name_the_others(&mut function.attrs, &mut function.sig, &mut function.block, &name)?;
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
                    enter(&mut method.sig, &mut method.block, &name);
                    let name = name.trim_end_matches(".new");
                    surplus::name_the_others(&mut method.attrs, &mut method.sig, &mut method.block, name)?;
                }
            }
            Ok(quote!(#methods))
        }
        other => Err(syn::Error::new_spanned(other, "entered: expected a function or an impl")),
    }
}

fn enter(signature: &mut Signature, body: &mut Block, name: &str) {
    if is_entry(body) {
        return;
    }
    let results = match &signature.output {
        ReturnType::Type(_, output) => is_result(output),
        ReturnType::Default => false,
    };
    *body = if results {
        parse_quote!({ crate::errors::caught(#name, move || #body) })
    } else {
        parse_quote!({ crate::errors::caught(#name, move || ::pyo3::PyResult::Ok((move || #body)())) })
    };
    if !results {
        signature.output = match &signature.output {
            ReturnType::Type(_, output) => parse_quote!(-> ::pyo3::PyResult<#output>),
            ReturnType::Default => parse_quote!(-> ::pyo3::PyResult<()>),
        };
    }
}

fn is_result(output: &Type) -> bool {
    matches!(output, Type::Path(path) if path.path.segments.last().is_some_and(|segment| segment.ident == "PyResult"))
}

/// Whether a body consists of one call of `entry`, preceded only by constants and `let py = x.py();`.
fn is_entry(body: &Block) -> bool {
    let Some((Stmt::Expr(Expr::Call(call), None), before)) = body.stmts.split_last() else { return false };
    let harmless = |statement: &Stmt| match statement {
        Stmt::Item(Item::Const(_)) => true,
        Stmt::Local(local) => local
            .init
            .as_ref()
            .is_some_and(|init| matches!(&*init.expr, Expr::MethodCall(call) if call.method == "py" && call.args.is_empty())),
        _ => false,
    };
    matches!(&*call.func, Expr::Path(path) if path.path.is_ident("entry")) && before.iter().all(harmless)
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
    fn a_body_that_is_an_entry_stays_as_it_is() {
        let entry = quote!(
            fn f(x: &Bound<'_, PyAny>) -> PyResult<f64> {
                const NAME: &str = "f";
                let py = x.py();
                entry(py, NAME, || Ok(1.0))
            }
        );
        assert_eq!(expanded(entry.clone()), entry.to_string().replace(' ', ""));
        let text = expanded(quote!(
            fn f(x: f64) -> PyResult<f64> {
                let y = risky(x);
                entry(py, NAME, || Ok(y))
            }
        ));
        assert!(text.contains("caught"), "{text}");
    }

    #[test]
    fn arguments_without_a_name_are_refused() {
        let text = expanded(quote! {
            impl Arm {
                #[pyo3(signature = (q, frame, *, out=None, scaled=true, kind="a", size=-1.0))]
                fn pose(&self, q: u8, frame: u8, out: Option<u8>, scaled: bool, kind: &str, size: f64) -> PyResult<u8> { Ok(1) }
                #[pyo3(signature = (q, out=None))]
                fn plain(&self, q: u8, out: Option<u8>) -> PyResult<u8> { Ok(1) }
            }
        });
        assert!(text.contains(r#"signature=(q,frame,*surplus,out=None,scaled=true,kind="a",size=-1.0)"#), "{text}");
        assert!(text.contains(r#"text_signature="($self,q,frame,*,out=None,scaled=True,kind='a',size=...)""#), "{text}");
        assert!(text.contains("frame:u8,surplus:&::pyo3::Bound<'_,::pyo3::types::PyTuple>,out:Option<u8>"), "{text}");
        assert!(text.contains(r#"require_names(surplus,"Arm.pose",2usize,"out=,scaled=,kind=,size=")?;"#), "{text}");
        assert!(text.contains("fnplain(&self,q:u8,out:Option<u8>)"), "{text}");
    }

    #[test]
    fn other_items_are_refused() {
        assert!(
            expand(quote!(
                struct Arm;
            ))
            .is_err()
        );
    }
}
