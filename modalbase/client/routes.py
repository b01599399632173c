"""The routes of the REST contract; `python -m tools.reference` makes this file from the service's routers."""

from __future__ import annotations

from typing import NamedTuple


class Route(NamedTuple):
    """A call: its method, its path below `/api/v1/`, the names of its query, what it does."""

    method: str
    path: str
    query: tuple[str, ...]
    summary: str

    @property
    def takes(self) -> tuple[str, ...]:
        """What stands in the path's braces."""
        return tuple(part.strip("{}") for part in self.path.split("/") if part.startswith("{"))


# fmt: off
# ruff: noqa: E501
ROUTES: dict[str, Route] = {
    "list_projects": Route(
        "GET", "projects", ("cursor", "limit", "deleted"),
        "Projects that one is a member of, archived ones included.",
    ),
    "create_project": Route(
        "POST", "projects", (),
        "Make a project; its maker is its owner.",
    ),
    "get_project": Route(
        "GET", "projects/{project_id}", (),
        "One project.",
    ),
    "change_project": Route(
        "PATCH", "projects/{project_id}", (),
        "Rename or describe a project, archive it or take it out of the archive; for owners.",
    ),
    "delete_project": Route(
        "DELETE", "projects/{project_id}", (),
        "Hide a project and all that is in it. It stays stored: an owner can restore it, or purge it for good.",
    ),
    "restore_project": Route(
        "POST", "projects/{project_id}/restore", (),
        "Bring a deleted project back.",
    ),
    "list_api_keys": Route(
        "GET", "api-keys", ("cursor", "limit"),
        "One's own keys, without their secrets.",
    ),
    "create_api_key": Route(
        "POST", "api-keys", (),
        "Make another key of one's own, with no more rights than the one that makes it; the answer alone shows it.",
    ),
    "revoke_api_key": Route(
        "DELETE", "api-keys/{key_id}", (),
        "Revoke a key of one's own: from now on it opens nothing.",
    ),
    "list_audit_events": Route(
        "GET", "audit-events", ("project", "cursor", "limit"),
        "What was done in one's projects and by oneself, newest first.",
    ),
    "list_members": Route(
        "GET", "projects/{project_id}/members", ("cursor", "limit"),
        "Who is in a project, and in which role.",
    ),
    "put_member": Route(
        "PUT", "projects/{project_id}/members/{member}", (),
        "Give a user, by name or id, a role in the project.",
    ),
    "delete_member": Route(
        "DELETE", "projects/{project_id}/members/{member}", (),
        "Take a user out of the project: an owner anybody, every member themselves.",
    ),
    "sign_in": Route(
        "POST", "session", (),
        "Begin a browser's session with the key of this request; the answer sets its cookie.",
    ),
    "sign_out": Route(
        "DELETE", "session", (),
        "End the session of this request's cookie, here and for whoever has its cookie.",
    ),
    "list_users": Route(
        "GET", "users", ("name", "cursor", "limit"),
        "All users; for administrators, with a key of the scope `admin`.",
    ),
    "get_user": Route(
        "GET", "users/{user_id}", (),
        "One user; for administrators.",
    ),
    "disable_user": Route(
        "POST", "users/{user_id}/disable", (),
        "Disable a user: from now on none of their keys opens anything; for administrators.",
    ),
    "enable_user": Route(
        "POST", "users/{user_id}/enable", (),
        "Enable a user who was disabled; for administrators.",
    ),
    "list_keys_of_user": Route(
        "GET", "users/{user_id}/api-keys", ("cursor", "limit"),
        "A user's keys, without their secrets; for administrators.",
    ),
    "end_key_of_user": Route(
        "PATCH", "users/{user_id}/api-keys/{key_id}", (),
        "Have a user's key expire, never later than it does already; for administrators.",
    ),
    "revoke_key_of_user": Route(
        "DELETE", "users/{user_id}/api-keys/{key_id}", (),
        "Revoke a user's key: from now on it opens nothing; for administrators.",
    ),
    "get_storage": Route(
        "GET", "projects/{project_id}/storage", (),
        "How many bytes a project stores, and how many it may.",
    ),
    "list_structures": Route(
        "GET", "projects/{project_id}/structures", ("cursor", "limit", "deleted"),
        "Structures of a project.",
    ),
    "create_structure": Route(
        "POST", "projects/{project_id}/structures", ("confirm",),
        "Describe a structure: geometry, density and either plies or a homogenised material, nominal values.",
    ),
    "get_structure": Route(
        "GET", "structures/{structure_id}", (),
        "A structure in its current version.",
    ),
    "change_structure": Route(
        "PATCH", "structures/{structure_id}", ("confirm",),
        "Change a structure. Geometry, density or section make a new version; what a result used stays as it was.",
    ),
    "delete_structure": Route(
        "DELETE", "structures/{structure_id}", (),
        "Hide a structure with its campaigns and monitors. It stays stored and can be restored.",
    ),
    "get_structure_version": Route(
        "GET", "structures/{structure_id}/versions/{number}", (),
        "What a structure was in an earlier version; results refer to it by number.",
    ),
    "restore_structure": Route(
        "POST", "structures/{structure_id}/restore", (),
        "Bring a deleted structure back.",
    ),
    "list_campaigns": Route(
        "GET", "structures/{structure_id}/campaigns", ("cursor", "limit", "deleted"),
        "Campaigns of a structure.",
    ),
    "create_campaign": Route(
        "POST", "structures/{structure_id}/campaigns", ("confirm",),
        "Describe a measurement: boundary, date, climate, instruments, and the frame of the file's coordinates.",
    ),
    "get_campaign": Route(
        "GET", "campaigns/{campaign_id}", (),
        "A campaign.",
    ),
    "change_campaign": Route(
        "PATCH", "campaigns/{campaign_id}", ("confirm",),
        "Change what is known of a campaign; results that exist keep what they used.",
    ),
    "delete_campaign": Route(
        "DELETE", "campaigns/{campaign_id}", (),
        "Hide a campaign and what is in it. It stays stored and can be restored.",
    ),
    "restore_campaign": Route(
        "POST", "campaigns/{campaign_id}/restore", (),
        "Bring a deleted campaign back.",
    ),
    "list_imports": Route(
        "GET", "campaigns/{campaign_id}/imports", ("cursor", "limit"),
        "Imports into a campaign, oldest first. A page is shorter where reports on many datasets would make it heavy.",
    ),
    "start_import": Route(
        "POST", "campaigns/{campaign_id}/imports", ("filename", "dry_run", "quantity", "kind", "mapping"),
        "Send a file as raw body or as multipart field `file`: UFF, npz, .mat, CSV or wav; a job reads it.",
    ),
    "get_import": Route(
        "GET", "imports/{import_id}", (),
        "How far an import is, what it brought in, and what became of each dataset.",
    ),
    "get_import_records": Route(
        "GET", "imports/{import_id}/records", (),
        "Time blocks that an import brought, and how the hits of their points are judged now.",
    ),
    "get_imports_original": Route(
        "GET", "imports/{import_id}/original", (),
        "The file as it was uploaded, byte for byte; its ETag is its SHA-256.",
    ),
    "purge_project": Route(
        "POST", "projects/{project_id}/purge", (),
        "Remove a deleted project and all that is in it for good. Nothing brings it back.",
    ),
    "purge_structure": Route(
        "POST", "structures/{structure_id}/purge", (),
        "Remove a deleted structure with its campaigns, results and monitors for good. Nothing brings it back.",
    ),
    "purge_campaign": Route(
        "POST", "campaigns/{campaign_id}/purge", (),
        "Remove a deleted campaign with its FRFs, original files and results for good. Nothing brings it back.",
    ),
    "get_grid_points": Route(
        "GET", "campaigns/{campaign_id}/grid-points", ("format",),
        "All grid points of a campaign, in the file's coordinates, as JSON or CSV.",
    ),
    "put_grid_points": Route(
        "PUT", "campaigns/{campaign_id}/grid-points", (),
        "Store these points in place of all that are there, from JSON `{items: [{label, x_m, y_m, z_m}]}` or CSV.",
    ),
    "list_records": Route(
        "GET", "campaigns/{campaign_id}/records", ("point", "hit", "cursor", "limit"),
        "Time blocks of a campaign, without their samples.",
    ),
    "create_records": Route(
        "POST", "campaigns/{campaign_id}/records", ("filename", "mapping", "dry_run"),
        "Send time blocks of hits as npz, .mat, CSV or wav with a mapping, or as JSON `{variables, mapping}`.",
    ),
    "list_frfs": Route(
        "GET", "campaigns/{campaign_id}/frfs", ("cursor", "limit", "point", "direction", "reference", "quantity", "import_id", "fmin", "fmax"),
        "FRFs of a campaign, without their spectra.",
    ),
    "create_frfs": Route(
        "POST", "campaigns/{campaign_id}/frfs", ("quantity", "mapping"),
        "Send FRFs of a script as npz, JSON or CSV, as `GET …/frfs/data` writes them, or an analyser's .mat with a mapping.",
    ),
    "get_campaign_data": Route(
        "GET", "campaigns/{campaign_id}/frfs/data", ("stride", "format", "point", "direction", "reference", "quantity", "import_id", "fmin", "fmax"),
        "Spectra of a campaign's FRFs, with their band and stride, as JSON, npz, CSV, Arrow or UFF.",
    ),
    "get_frf": Route(
        "GET", "frfs/{frf_id}", (),
        "An FRF without its spectrum.",
    ),
    "get_frf_data": Route(
        "GET", "frfs/{frf_id}/data", ("fmin", "fmax", "stride", "format"),
        "Spectrum of one FRF, in a band and with a stride if wanted, as JSON, npz, CSV, Arrow or UFF.",
    ),
    "get_record": Route(
        "GET", "records/{record_id}", (),
        "A time block without its samples.",
    ),
    "delete_record": Route(
        "DELETE", "records/{record_id}", (),
        "Delete a time block. FRFs that were made of it stay.",
    ),
    "get_record_data": Route(
        "GET", "records/{record_id}/data", ("format",),
        "Samples of a time block in SI with their time axis, as JSON, npz or CSV.",
    ),
    "list_processings": Route(
        "GET", "campaigns/{campaign_id}/processings", ("cursor", "limit"),
        "Processings of a campaign, newest first.",
    ),
    "start_processing": Route(
        "POST", "campaigns/{campaign_id}/processings", (),
        "Queue a processing of the campaign's records: hits are judged, the good ones become FRFs. `{}` is a body.",
    ),
    "get_processing": Route(
        "GET", "processings/{processing_id}", (),
        "How far a processing is, how it judged every hit, and which FRFs rest on which records.",
    ),
    "list_mode_sets": Route(
        "GET", "campaigns/{campaign_id}/mode-sets", ("cursor", "limit"),
        "Mode sets of a campaign.",
    ),
    "create_mode_set": Route(
        "POST", "campaigns/{campaign_id}/mode-sets", (),
        "Type in modes that were identified elsewhere: frequencies, and where known damping ratios and shapes.",
    ),
    "edit_mode_set": Route(
        "POST", "mode-sets/{mode_set_id}/edits", (),
        "Keep or drop poles by hand: a new mode set that records who decided what and why; the old one stays as it is.",
    ),
    "get_mode_set": Route(
        "GET", "mode-sets/{mode_set_id}", ("format",),
        "A mode set, as JSON or as a UFF file of grid points and mode shapes.",
    ),
    "list_identifications": Route(
        "GET", "campaigns/{campaign_id}/identifications", ("cursor", "limit"),
        "Identifications of a campaign, newest first.",
    ),
    "start_identification": Route(
        "POST", "campaigns/{campaign_id}/identifications", (),
        "Queue an identification of modes from the campaign's FRFs; a mode set comes of it. `{}` is a body.",
    ),
    "cancel_identification": Route(
        "POST", "identifications/{identification_id}/cancel", (),
        "Ask for an identification's end; one that has ended already stays as it is.",
    ),
    "get_identification": Route(
        "GET", "identifications/{identification_id}", (),
        "How far an identification is, which modes it found, and how well the data support them.",
    ),
    "list_batches": Route(
        "GET", "structures/{structure_id}/coupon-batches", ("cursor", "limit"),
        "Coupon batches of a structure.",
    ),
    "create_batch": Route(
        "POST", "structures/{structure_id}/coupon-batches", ("confirm",),
        "Open a batch: which constants it gives, and published means of those that have no specimens here.",
    ),
    "get_batch": Route(
        "GET", "coupon-batches/{batch_id}", (),
        "A coupon batch.",
    ),
    "list_coupons": Route(
        "GET", "coupon-batches/{batch_id}/coupons", ("cursor", "limit"),
        "Specimens of a batch, excluded ones included.",
    ),
    "create_coupons": Route(
        "POST", "coupon-batches/{batch_id}/coupons", ("confirm",),
        "Record specimens: results of one, or of several as a list, in JSON; or the raw curve of one as multipart.",
    ),
    "get_summary": Route(
        "GET", "coupon-batches/{batch_id}/summary", (),
        "Mean, n-1 standard deviation and coefficient of variation of each property, and the constants that follow.",
    ),
    "get_coupon": Route(
        "GET", "coupons/{coupon_id}", (),
        "A specimen.",
    ),
    "change_coupon": Route(
        "PATCH", "coupons/{coupon_id}", (),
        "Exclude a specimen from its batch with a reason, or take it back in. It stays recorded either way.",
    ),
    "get_curve": Route(
        "GET", "coupons/{coupon_id}/curve", (),
        "Where a specimen's raw curve came from, how it was read, and all that its standard reports of it.",
    ),
    "get_curve_data": Route(
        "GET", "coupons/{coupon_id}/curve/data", ("format",),
        "The raw curve in SI: force N, strains m/m, time s.",
    ),
    "get_coupons_curve_original": Route(
        "GET", "coupons/{coupon_id}/curve/original", (),
        "The testing machine's file as it was uploaded, byte for byte.",
    ),
    "start_update": Route(
        "POST", "campaigns/{campaign_id}/update-jobs", ("priority", "confirm"),
        "Queue an update of the campaign's structure. `{}` is a recipe.",
    ),
    "list_update_jobs": Route(
        "GET", "update-jobs", ("project", "structure", "campaign", "status", "cursor", "limit"),
        "Update jobs that you may see, newest first; those of deleted structures are left out.",
    ),
    "start_updates": Route(
        "POST", "update-jobs", ("priority", "confirm"),
        "Queue updates of many campaigns: all of them, or with any fault none.",
    ),
    "get_update_job": Route(
        "GET", "update-jobs/{job_id}", (),
        "How far an update is, or what became of it.",
    ),
    "cancel_update_job": Route(
        "POST", "update-jobs/{job_id}/cancel", (),
        "Ask for an update's end; one that has ended already stays as it is.",
    ),
    "retry_update_job": Route(
        "POST", "update-jobs/{job_id}/retry", (),
        "Queue an update again that failed or was cancelled.",
    ),
    "watch_update_job": Route(
        "GET", "update-jobs/{job_id}/events", (),
        "The job's state now and whenever it changes, as server-sent events of the type `job`; ends when the job has.",
    ),
    "get_result": Route(
        "GET", "update-jobs/{job_id}/result", ("include",),
        "Verdict and warnings first, then parameters, modes, correlation, and where all of it came from.",
    ),
    "list_joint_updates": Route(
        "GET", "projects/{project_id}/joint-updates", ("cursor", "limit"),
        "Joint updates of a project, newest first.",
    ),
    "get_joint_update": Route(
        "GET", "joint-updates/{joint_id}", (),
        "How far a joint update is, or what became of it.",
    ),
    "cancel_joint_update": Route(
        "POST", "joint-updates/{joint_id}/cancel", (),
        "Ask for a joint update's end; one that has ended already stays as it is.",
    ),
    "watch_joint_update": Route(
        "GET", "joint-updates/{joint_id}/events", (),
        "The job's state now and whenever it changes, as server-sent events of the type `job`; ends when the job has.",
    ),
    "get_joint_result": Route(
        "GET", "joint-updates/{joint_id}/result", (),
        "The material's constants from all campaigns, each campaign's part, and whether they agree.",
    ),
    "plan": Route(
        "POST", "structures/{structure_id}/plans", (),
        "Rank tests by what they would add to what is known of the material. `{}` compares boundaries and an added mass.",
    ),
    "get_predicted_frfs": Route(
        "GET", "update-jobs/{job_id}/frfs/data", ("model", "point", "direction", "reference", "fmin", "fmax", "stride", "format"),
        "FRFs that the model predicts where FRFs were measured, in the formats, coordinates and order of the measured ones.",
    ),
    "get_cards": Route(
        "GET", "update-jobs/{job_id}/cards", ("format", "element"),
        "The updated model as a deck that CalculiX, Abaqus or Nastran runs: mesh, material, thickness, damping, supports.",
    ),
    "list_figures": Route(
        "GET", "update-jobs/{job_id}/figures", (),
        "Names of the figures, and which of them this result can be drawn as.",
    ),
    "get_figure": Route(
        "GET", "update-jobs/{job_id}/figures/{name}", ("point", "reference", "fmin", "fmax", "measured", "model", "format", "theme"),
        "A figure of the result: Plotly JSON, or the same figure as SVG, PNG or PDF.",
    ),
    "get_report": Route(
        "GET", "update-jobs/{job_id}/report", ("format",),
        "The report of a result: two pages for who ordered the test, the rest as annex for who checks it.",
    ),
    "list_joint_figures": Route(
        "GET", "joint-updates/{joint_id}/figures", (),
        "Names of the figures of a joint update, and which of them its result can be drawn as.",
    ),
    "get_joint_figure": Route(
        "GET", "joint-updates/{joint_id}/figures/{name}", ("format", "theme"),
        "A figure of a joint update: `parameters`, `campaigns`, `frequencies`, `budget` or `posterior`.",
    ),
    "get_campaign_figure": Route(
        "GET", "campaigns/{campaign_id}/figures/{name}", ("point", "direction", "response", "format", "theme"),
        "The figure `hits` of a point: the good ones alike, each bad one in a colour of its own with what was found against it.",
    ),
    "get_identification_figure": Route(
        "GET", "identifications/{identification_id}/figures/{name}", ("format", "theme"),
        "The figure `stabilisation` of an identification; 409 while it has found nothing, or where it failed.",
    ),
    "get_coupon_figure": Route(
        "GET", "coupons/{coupon_id}/figures/{name}", ("format", "theme"),
        "The figure `curve`: raw curve, chord, bounds, strength; of D3518 the 0.2 % offset, of D3039 the transverse strain.",
    ),
    "get_series_figure": Route(
        "GET", "monitors/{monitor_id}/series/figure", ("parameter", "series", "format", "theme"),
        "The series of a parameter as a figure: Plotly JSON for the browser and notebooks, or SVG, PNG, PDF for print.",
    ),
    "list_monitors_of_structure": Route(
        "GET", "structures/{structure_id}/monitors", ("cursor", "limit", "deleted"),
        "Monitors of a structure.",
    ),
    "create_monitor": Route(
        "POST", "structures/{structure_id}/monitors", ("confirm",),
        "Watch a structure: a frozen recipe, a baseline, parameters and how often it may call in vain.",
    ),
    "list_monitors": Route(
        "GET", "monitors", ("state", "cursor", "limit", "deleted"),
        "One's monitors of all structures, worst state first.",
    ),
    "get_monitor": Route(
        "GET", "monitors/{monitor_id}", (),
        "A monitor and its state.",
    ),
    "change_monitor": Route(
        "PATCH", "monitors/{monitor_id}", (),
        "Change a name, a receiver, the expected interval, or put a monitor at rest. What decides is frozen.",
    ),
    "delete_monitor": Route(
        "DELETE", "monitors/{monitor_id}", (),
        "Hide a monitor with its series and alarms, and end its work. It stays stored and can be restored.",
    ),
    "restore_monitor": Route(
        "POST", "monitors/{monitor_id}/restore", (),
        "Bring a deleted monitor back; campaigns that came in between are run.",
    ),
    "list_runs": Route(
        "GET", "monitors/{monitor_id}/runs", ("series", "cursor", "limit"),
        "Every run of a monitor, with the ones that were superseded or refused, newest first.",
    ),
    "start_runs": Route(
        "POST", "monitors/{monitor_id}/runs", (),
        "Run campaigns by hand: one, all that have not been run (backfill, in time order), or all anew.",
    ),
    "get_series": Route(
        "GET", "monitors/{monitor_id}/series", ("series",),
        "The series: values with their uncertainty, baseline, limits, corrected and raw, alarms and campaigns as marks.",
    ),
    "complete_campaign": Route(
        "POST", "campaigns/{campaign_id}/complete", (),
        "Say that everything of a campaign is in, so that its structure's monitors need not wait. Saying it twice is fine.",
    ),
    "list_alarms": Route(
        "GET", "alarms", ("state", "monitor", "project", "cursor", "limit"),
        "Alarms of one's projects, newest first, each with its history; those of deleted monitors are left out.",
    ),
    "get_alarm": Route(
        "GET", "alarms/{alarm_id}", (),
        "An alarm with its history.",
    ),
    "acknowledge_alarm": Route(
        "POST", "alarms/{alarm_id}/acknowledge", (),
        "Say that you have seen an alarm, and what you make of it. The monitor is judged anew with that.",
    ),
    "list_deliveries_of_monitor": Route(
        "GET", "monitors/{monitor_id}/deliveries", ("cursor", "limit"),
        "The messages of a monitor, by webhook and mail, newest first.",
    ),
    "list_webhooks": Route(
        "GET", "webhooks", ("project", "cursor", "limit"),
        "Webhooks of one's projects.",
    ),
    "create_webhook": Route(
        "POST", "webhooks", (),
        "Have a project's events posted to a URL, signed as Standard Webhooks says. The answer alone shows the secret.",
    ),
    "delete_webhook": Route(
        "DELETE", "webhooks/{webhook_id}", (),
        "Post nothing there any more; what waits is given up, what was sent stays listed with the monitor.",
    ),
    "test_webhook": Route(
        "POST", "webhooks/{webhook_id}/test", (),
        "Send a message without an event, to try the webhook.",
    ),
    "list_deliveries": Route(
        "GET", "webhooks/{webhook_id}/deliveries", ("cursor", "limit"),
        "What was sent to a webhook, or waits to be, newest first.",
    ),
    "replay_delivery": Route(
        "POST", "deliveries/{delivery_id}/replay", (),
        "Send a message again, under the same `webhook-id`: a receiver that has it already recognises it.",
    ),
}
