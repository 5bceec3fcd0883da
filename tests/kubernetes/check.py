"""Checks Kubernetes manifests against the schemas of Kubernetes and KEDA: check.py VERSION,VERSION FILE…

Unknown fields are errors. To check the check itself, each document is also tried with planted errors, which must be found.
"""

import copy
import sys

import kubernetes_validate
import yaml
from cloudcoil.models.keda.v1alpha1 import ScaledObject, TriggerAuthentication

KEDA = {"ScaledObject": ScaledObject, "TriggerAuthentication": TriggerAuthentication}


def faults(document, version):
    """The first fault of a document, or None."""
    if document["apiVersion"].startswith("keda.sh/"):
        model = KEDA[document["kind"]]
        try:
            # The model drops fields that it does not know.
            read = model.model_validate(document).model_dump(mode="json", by_alias=True, exclude_unset=True)
        except ValueError as error:
            return str(error)
        return None if read == document else "a field is unknown to KEDA"
    try:
        kubernetes_validate.validate(document, version, strict=True)
    except kubernetes_validate.ValidationError as error:
        return f"{'.'.join(map(str, error.path))}: {error.message}"
    return None


def planted(document):
    """The document with a misspelled field, and with a field of another type."""
    unknown = copy.deepcopy(document)
    unknown["spec"]["replica"] = 1
    other_type = copy.deepcopy(document)
    other_type["spec"] = [document["spec"]]
    return unknown, other_type


def main():
    versions, files = sys.argv[1].split(","), sys.argv[2:]
    count, found = 0, 0
    for name in files:
        with open(name, encoding="utf-8") as file:
            documents = list(yaml.safe_load_all(file))
        for document in documents:
            if document["kind"] == "Kustomization":
                continue
            for version in versions:
                fault = faults(document, version)
                if fault:
                    sys.exit(f"{name}: {document['kind']} {document['metadata']['name']}: {fault}")
                for wrong in planted(document):
                    if not faults(wrong, version):
                        sys.exit(f"{name}: {document['kind']}: a planted error was not found")
                    found += 1
                count += 1
    if count < 10:
        sys.exit(f"only {count} checks")
    print(f"{count} checks of documents, Kubernetes {', '.join(versions)}: valid; {found} of {found} planted errors found")


main()
