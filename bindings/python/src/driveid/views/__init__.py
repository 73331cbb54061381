# SPDX-License-Identifier: Apache-2.0
"""One set of views in four places: workbench, terminal monitor, report and notebook.

``model`` turns JSON documents into view data, ``figure`` and ``pieces`` draw them, ``report``, ``notebook``, ``workbench`` and ``watch`` show them."""
