#!/bin/sh
# workflows.sh PYTHON..: check the files of .github with their schemas, and the workflows with zizmor, which finds unsafe steps. Both work
# without the network.
set -eu
"$@" -m check_jsonschema --builtin-schema vendor.github-workflows .github/workflows/*.yml
"$@" -m check_jsonschema --builtin-schema custom.github-workflows-require-timeout .github/workflows/*.yml
"$@" -m check_jsonschema --builtin-schema vendor.github-issue-config .github/ISSUE_TEMPLATE/config.yml
for form in .github/ISSUE_TEMPLATE/*.yml; do
    if [ "$form" != .github/ISSUE_TEMPLATE/config.yml ]; then
        "$@" -m check_jsonschema --builtin-schema vendor.github-issue-forms "$form"
    fi
done
"$(dirname "$1")/zizmor" --offline --quiet --strict-collection --config .github/zizmor.yml .github/workflows
