# SPDX-License-Identifier: Apache-2.0
"""Routes of the workbench. Addresses: /PAGE?p=PROJECT&add=EFFECT,EFFECT&... ; the same parameters go to the answers under /api."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable
from importlib import import_module, resources
from pathlib import Path

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles

from ...errors import DriveidError
from . import export, pages
from . import chain as chains
from .chain import Chain
from .engine import Engine, Trouble
from .jobs import Pending
from .live import Live
from .projects import Project, Projects
from .wire import pack

PAGES = ("live", "compare", "where", "missing", "falls")
WAIT_S = 0.15  # short answers come with the first question


class Workbench:
    """The application's parts, and one method a route."""

    def __init__(self, projects: Projects, engine: Engine, live: Live, start: str, token: str = "") -> None:
        self.projects, self.engine, self.live, self.start, self.token = projects, engine, live, start, token
        self.shell = resources.files("driveid.views").joinpath("static/workbench.html").read_text("utf-8")

    # What the question is about -----------------------------------------------------------------------------------

    def _project(self, request: Request) -> Project:
        project = self.projects.get(request.query_params.get("p", ""))
        if project is None:
            raise Trouble("this workbench does not know that project: open its model and records again")
        return project

    @staticmethod
    def _chain(text: str) -> Chain:
        return chains.parse(text)

    def _record(self, request: Request) -> int:
        return max(int(request.query_params.get("r", "0") or 0), 0)

    async def _answer(self, request: Request, work: Callable) -> object:
        """Run in the background; the question's own address is the key."""
        key = (request.url.path, request.url.query)
        return await asyncio.to_thread(self.engine.jobs.run, key, work, WAIT_S)

    # Pages --------------------------------------------------------------------------------------------------------

    async def home(self, request: Request) -> Response:
        return RedirectResponse(self.start, 303)

    async def page(self, request: Request) -> Response:
        return HTMLResponse(self.shell, headers={"cache-control": "no-store"})

    async def project(self, request: Request) -> Response:
        project, chain = self._project(request), self._chain(request.query_params.get("add", ""))
        return JSONResponse(await self._answer(request, lambda tell: pages.project_page(self.engine, project, chain)))

    async def compare(self, request: Request) -> Response:
        project, chain, record = self._project(request), self._chain(request.query_params.get("add", "")), self._record(request)
        return JSONResponse(await self._answer(request, lambda tell: pages.compare_page(self.engine, project, chain, record, tell)))

    async def trace(self, request: Request) -> Response:
        project, record, q = self._project(request), self._record(request), request.query_params
        begin, end, pixels = float(q["t0"]), float(q["t1"]), min(max(int(q.get("px", "1000")), 50), 4000)
        if q.get("pair"):
            chains = [self._chain(c) for c in q["chains"].split("|")] if "chains" in q else []
            others = [int(n) for n in q.get("others", "").split(",") if n]
            head, arrays = await self._answer(request, lambda tell: pages.pair_trace(self.engine, project, chains, others, record, q["pair"], begin, end, pixels, tell))
        else:
            names = [n for n in q.get("names", "").split(",") if n]
            head, arrays = await self._answer(request, lambda tell: pages.signal_trace(self.engine, project, record, names, begin, end, pixels))
        return Response(pack(head, arrays), media_type="application/octet-stream")

    async def where(self, request: Request) -> Response:
        project, chain, record = self._project(request), self._chain(request.query_params.get("add", "")), self._record(request)
        equation = request.query_params.get("eq", "")
        head, arrays = await self._answer(request, lambda tell: pages.cloud_page(self.engine, project, chain, record, equation, tell))
        return Response(pack(head, arrays), media_type="application/octet-stream")

    async def regimes(self, request: Request) -> Response:
        project, chain = self._project(request), self._chain(request.query_params.get("add", ""))
        return JSONResponse(await self._answer(request, lambda tell: pages.regimes_page(self.engine, project, chain, tell)))

    async def missing(self, request: Request) -> Response:
        project, chain = self._project(request), self._chain(request.query_params.get("add", ""))
        return JSONResponse(await self._answer(request, lambda tell: pages.missing_page(self.engine, project, chain, tell)))

    async def evidence(self, request: Request) -> Response:
        project, chain, record = self._project(request), self._chain(request.query_params.get("add", "")), self._record(request)
        effect, beside = request.query_params.get("effect", ""), self._chain(request.query_params.get("beside", ""))
        return JSONResponse(await self._answer(request, lambda tell: pages.evidence(self.engine, project, chain, effect, beside, record, tell)))

    async def falls(self, request: Request) -> Response:
        project, chain, kind = self._project(request), self._chain(request.query_params.get("add", "")), request.query_params.get("kind", "")
        return JSONResponse(await self._answer(request, lambda tell: pages.stairs_page(self.engine, project, chain, kind, tell)))

    async def improve(self, request: Request) -> Response:
        project, chain = self._project(request), self._chain(request.query_params.get("add", ""))
        document = await self._answer(request, lambda tell: self.engine.improved(project, chain, tell))
        found = [s["effect"] for s in document.get("steps") or [] if s.get("effect") for _ in range(chains.orders(s.get("parameters") or ()))]
        return JSONResponse({"add": [*chain, *found], "ends": document.get("ends", "")})

    async def own(self, request: Request) -> Response:
        """An own effect as an element of the address, once the library has read it."""
        project, chain, q = self._project(request), self._chain(request.query_params.get("add", "")), request.query_params
        element = chains.own(q.get("name", "").strip(), q.get("formula", "").strip(), q.get("adds_to", ""))

        def work(tell):
            self.engine.add(self.engine.model_toml(project, chain, tell), element)
            return {"element": element}

        return JSONResponse(await self._answer(request, work))

    # Projects and exports -----------------------------------------------------------------------------------------

    async def known(self, request: Request) -> Response:
        return JSONResponse({"projects": [{"id": p.id, "name": p.name, "records": [Path(r).name for r, _ in p.records]} for p in self.projects.all()], "start": self.start,
                             "token": self.token})

    async def open(self, request: Request) -> Response:
        data = await request.json()
        lines = {k: tuple(x.strip() for x in str(data.get(k, "")).splitlines() if x.strip()) for k in ("training", "held_out", "maps", "dbc")}
        if not lines["training"]:
            raise Trouble("name at least one record, one path a line")
        model = self._model_text(str(data.get("model", "")).strip(), str(data.get("structure", "")).strip(), str(data.get("given", "")).split())
        name = str(data.get("name", "")).strip() or Path(lines["training"][0]).stem
        project = Project(name, model, lines["training"], lines["held_out"], lines["maps"], str(data.get("hold", "")), lines["dbc"])
        await asyncio.to_thread(self.engine.records, project)  # errors of the reader come back now
        return JSONResponse({"id": self.projects.add(project)})

    def _model_text(self, path: str, structure: str, given: list[str]) -> str:
        if path:
            try:
                return Path(path).expanduser().read_text("utf-8")
            except OSError as error:
                raise Trouble(f"{path}: {error.strerror}") from error
        return self.engine.new(structure, given)

    async def export(self, request: Request) -> Response:
        project, chain, what = self._project(request), self._chain(request.query_params.get("add", "")), request.path_params["what"]
        work = {"report.html": lambda tell: export.report_html(self.engine, project, chain, tell), "model.toml": lambda tell: self.engine.model_toml(project, chain, tell),
                "driveidd.toml": lambda tell: export.daemon_toml(self.engine, project, chain)}.get(what)
        if work is None:
            raise Trouble(f"there is no export {what}")
        text = await self._answer(request, work)
        kind = "text/html" if what.endswith("html") else "application/toml"
        return Response(text, media_type=f"{kind}; charset=utf-8", headers={"content-disposition": f'attachment; filename="{what}"'})

    # Application --------------------------------------------------------------------------------------------------

    def application(self) -> Starlette:
        api = [Route(f"/{name}", getattr(self, name)) for name in ("project", "compare", "trace", "where", "regimes", "missing", "evidence", "falls", "improve", "own", "known")]
        api += [Route("/open", self.open, methods=["POST"]), Route("/export/{what}", self.export)]
        static = StaticFiles(directory=str(resources.files("driveid.views").joinpath("static")))
        routes = [Route("/", self.home), *[Route(f"/{p}", self.page) for p in PAGES], Mount("/api", routes=api), Mount("/static", static), WebSocketRoute("/ws/live", self.live.serve)]
        handlers = {Pending: _pending, Trouble: _trouble, DriveidError: _trouble, ValueError: _trouble, KeyError: _trouble, IndexError: _trouble, json.JSONDecodeError: _trouble}
        return Starlette(routes=routes, exception_handlers=handlers, lifespan=self._lifespan)

    @contextlib.asynccontextmanager
    async def _lifespan(self, app: Starlette):
        with contextlib.suppress(ImportError):  # loaded before the first record is opened, which then need not wait for it
            await asyncio.to_thread(import_module, "pyarrow.parquet")
        yield
        await self.live.stop()
        self.engine.jobs.close()


async def _pending(request: Request, error: Pending) -> Response:
    return JSONResponse({"done": error.done, "what": error.what}, 202)


async def _trouble(request: Request, error: Exception) -> Response:
    return JSONResponse({"message": str(error) or type(error).__name__}, 422)
