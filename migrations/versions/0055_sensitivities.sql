-- The schema at revision 0055_sensitivities: what pg_dump wrote of a database that the steps before it
-- had made, without the queue's own tables. It never changes; later revisions say what became of it.

CREATE TABLE alarm_events (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    alarm_id uuid NOT NULL,
    event character varying NOT NULL,
    user_id uuid,
    note character varying NOT NULL
);

CREATE TABLE alarms (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    monitor_id uuid NOT NULL,
    parameter character varying NOT NULL,
    campaign_id uuid NOT NULL,
    series integer NOT NULL,
    state character varying NOT NULL,
    acknowledged_at timestamp with time zone,
    acknowledged_by uuid,
    note character varying,
    details jsonb NOT NULL,
    CONSTRAINT ck_alarms_state CHECK (state IN ('alarm', 'acknowledged', 'cleared', 'withdrawn'))
);

CREATE TABLE api_keys (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    user_id uuid NOT NULL,
    name character varying NOT NULL,
    prefix character varying NOT NULL,
    secret_sha256 bytea NOT NULL,
    last_used_at timestamp with time zone,
    revoked_at timestamp with time zone,
    expires_at timestamp with time zone,
    scopes jsonb DEFAULT '["read", "write", "jobs", "admin"]'::jsonb NOT NULL
);

CREATE TABLE audit_events (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    user_id uuid,
    project_id uuid,
    action character varying NOT NULL,
    subject_type character varying NOT NULL,
    subject_id uuid,
    detail jsonb NOT NULL,
    request_id character varying
);

CREATE TABLE browser_sessions (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    key_id uuid NOT NULL,
    token_sha256 bytea NOT NULL,
    expires_at timestamp with time zone NOT NULL
);

CREATE TABLE campaign_completions (
    campaign_id uuid NOT NULL,
    user_id uuid NOT NULL,
    completed_at timestamp with time zone DEFAULT now() NOT NULL
);

CREATE TABLE campaigns (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    structure_id uuid NOT NULL,
    name character varying NOT NULL,
    boundary character varying NOT NULL,
    performed_at timestamp with time zone,
    temperature_c double precision,
    humidity_percent double precision,
    instruments jsonb NOT NULL,
    frame jsonb,
    notes character varying NOT NULL,
    updated_at timestamp with time zone DEFAULT now() NOT NULL,
    deleted_at timestamp with time zone,
    inputs jsonb,
    tags character varying[] DEFAULT '{}'::character varying[] NOT NULL,
    meta jsonb DEFAULT '{}'::jsonb NOT NULL
);

CREATE TABLE coupon_batches (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    structure_id uuid NOT NULL,
    name character varying NOT NULL,
    constants jsonb NOT NULL,
    published jsonb NOT NULL,
    conditions jsonb NOT NULL,
    sets jsonb NOT NULL
);

CREATE TABLE coupon_curves (
    coupon_id uuid NOT NULL,
    filename character varying NOT NULL,
    file_sha256 bytea NOT NULL,
    file_size integer NOT NULL,
    request jsonb NOT NULL,
    reading jsonb NOT NULL,
    reduction jsonb NOT NULL,
    software character varying NOT NULL,
    series jsonb NOT NULL,
    points integer NOT NULL,
    sha256 bytea NOT NULL,
    file bytea NOT NULL,
    data bytea NOT NULL
);
ALTER TABLE coupon_curves ALTER COLUMN data SET STORAGE EXTERNAL;

CREATE TABLE coupons (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    batch_id uuid NOT NULL,
    specimen character varying NOT NULL,
    standard character varying NOT NULL,
    e_pa double precision,
    g_pa double precision,
    nu double precision,
    strength_pa double precision,
    ultimate_strain double precision,
    failure_code character varying,
    excluded boolean NOT NULL,
    exclusion_reason character varying,
    CONSTRAINT ck_coupons_exclusion_reason CHECK ((excluded = (exclusion_reason IS NOT NULL)))
);

CREATE TABLE deliveries (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    project_id uuid NOT NULL,
    monitor_id uuid,
    webhook_id uuid,
    recipient character varying,
    message_id character varying NOT NULL,
    event character varying NOT NULL,
    body character varying NOT NULL,
    state character varying DEFAULT 'waiting'::character varying NOT NULL,
    attempts integer DEFAULT 0 NOT NULL,
    due_at timestamp with time zone DEFAULT now() NOT NULL,
    last_status integer,
    last_error character varying,
    delivered_at timestamp with time zone,
    CONSTRAINT ck_deliveries_receiver CHECK (((webhook_id IS NULL) = (recipient IS NOT NULL))),
    CONSTRAINT ck_deliveries_state CHECK (state IN ('waiting', 'delivered', 'failed'))
);

CREATE TABLE forecasts (
    id uuid NOT NULL,
    structure_id uuid NOT NULL,
    structure_version_id uuid NOT NULL,
    request jsonb NOT NULL,
    document json,
    arrays bytea
);
ALTER TABLE forecasts ALTER COLUMN arrays SET STORAGE EXTERNAL;

CREATE TABLE frfs (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    campaign_id uuid NOT NULL,
    import_id uuid,
    dataset integer,
    label character varying NOT NULL,
    response_point bigint NOT NULL,
    response_direction integer NOT NULL,
    reference_point bigint NOT NULL,
    reference_direction integer NOT NULL,
    quantity character varying NOT NULL,
    averages integer,
    start_hz double precision NOT NULL,
    end_hz double precision NOT NULL,
    step_hz double precision,
    lines integer NOT NULL,
    dtype character varying NOT NULL,
    sha256 bytea NOT NULL,
    coherence_dtype character varying,
    coherence_sha256 bytea,
    axis bytea,
    data bytea NOT NULL,
    coherence bytea,
    processing_id uuid,
    window_rate_per_s double precision,
    variance_sha256 bytea,
    variance bytea,
    tags character varying[] DEFAULT '{}'::character varying[] NOT NULL,
    meta jsonb DEFAULT '{}'::jsonb NOT NULL,
    window_rate_sd_per_s double precision,
    CONSTRAINT ck_frfs_axis CHECK (((step_hz IS NULL) = (axis IS NOT NULL)))
);
ALTER TABLE frfs ALTER COLUMN axis SET STORAGE EXTERNAL;
ALTER TABLE frfs ALTER COLUMN data SET STORAGE EXTERNAL;
ALTER TABLE frfs ALTER COLUMN coherence SET STORAGE EXTERNAL;
ALTER TABLE frfs ALTER COLUMN variance SET STORAGE EXTERNAL;

CREATE TABLE grid_points (
    campaign_id uuid NOT NULL,
    label bigint NOT NULL,
    x_m double precision NOT NULL,
    y_m double precision NOT NULL,
    z_m double precision NOT NULL
);

CREATE TABLE hit_decisions (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    campaign_id uuid NOT NULL,
    point bigint NOT NULL,
    direction integer NOT NULL,
    hit bigint NOT NULL,
    good boolean,
    why character varying NOT NULL,
    by character varying NOT NULL
);

CREATE TABLE identifications (
    id uuid NOT NULL,
    campaign_id uuid NOT NULL,
    options jsonb NOT NULL,
    document json
);

CREATE TABLE imports (
    id uuid NOT NULL,
    campaign_id uuid NOT NULL,
    filename character varying NOT NULL,
    sha256 bytea NOT NULL,
    dry_run boolean NOT NULL,
    quantity character varying,
    counts jsonb,
    datasets jsonb,
    warnings jsonb,
    format character varying,
    kind character varying,
    mapping jsonb,
    found jsonb,
    trace_lines jsonb
);

CREATE TABLE instrument_uses (
    campaign_id uuid NOT NULL,
    number integer NOT NULL,
    kind character varying NOT NULL,
    serial character varying,
    model character varying,
    points bigint[],
    others bigint[] DEFAULT '{}'::bigint[] NOT NULL,
    instrument_id uuid,
    calibrated_on date,
    calibrated_until date,
    calibration_expired boolean
);

CREATE TABLE instruments (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    project_id uuid NOT NULL,
    kind character varying NOT NULL,
    serial character varying NOT NULL,
    model character varying NOT NULL,
    notes character varying NOT NULL,
    calibrations jsonb NOT NULL,
    updated_at timestamp with time zone DEFAULT now() NOT NULL,
    deleted_at timestamp with time zone
);

CREATE TABLE job_checkpoints (
    job_id uuid NOT NULL,
    attempt integer NOT NULL,
    saved_at timestamp with time zone DEFAULT now() NOT NULL,
    data bytea NOT NULL
);
ALTER TABLE job_checkpoints ALTER COLUMN data SET STORAGE EXTERNAL;

CREATE TABLE jobs (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    kind character varying NOT NULL,
    project_id uuid NOT NULL,
    queue character varying NOT NULL,
    state character varying DEFAULT 'queued'::character varying NOT NULL,
    priority integer DEFAULT 0 NOT NULL,
    attempt integer DEFAULT 0 NOT NULL,
    max_attempts integer DEFAULT 3 NOT NULL,
    worker character varying,
    stage character varying,
    progress double precision DEFAULT '0'::double precision NOT NULL,
    message character varying,
    error jsonb,
    queued_at timestamp with time zone DEFAULT now() NOT NULL,
    started_at timestamp with time zone,
    finished_at timestamp with time zone,
    cancel_requested boolean DEFAULT false NOT NULL,
    losses integer DEFAULT 0 NOT NULL,
    request_id character varying,
    version integer DEFAULT 0 NOT NULL,
    ticket bigint,
    CONSTRAINT ck_jobs_progress CHECK (((progress >= (0)::double precision) AND (progress <= (1)::double precision))),
    CONSTRAINT ck_jobs_state CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled'))
);

CREATE TABLE joint_updates (
    id uuid NOT NULL,
    project_id uuid NOT NULL,
    request jsonb NOT NULL,
    campaigns jsonb NOT NULL,
    idempotency_key character varying,
    document json
);

CREATE TABLE members (
    project_id uuid NOT NULL,
    user_id uuid NOT NULL,
    role character varying NOT NULL,
    CONSTRAINT ck_members_role CHECK (role IN ('viewer', 'editor', 'owner'))
);

CREATE TABLE mode_sets (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    campaign_id uuid NOT NULL,
    import_id uuid,
    job_id uuid,
    name character varying NOT NULL,
    origin character varying NOT NULL,
    covariance jsonb,
    details jsonb DEFAULT '{}'::jsonb NOT NULL
);

CREATE TABLE modes (
    mode_set_id uuid NOT NULL,
    number integer NOT NULL,
    frequency_hz double precision NOT NULL,
    damping_ratio double precision,
    frequency_sd_hz double precision,
    damping_sd double precision,
    shape jsonb
);

CREATE TABLE monitor_assessments (
    id uuid NOT NULL,
    series_id uuid NOT NULL,
    digest character varying NOT NULL
);

CREATE TABLE monitor_runs (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    series_id uuid NOT NULL,
    campaign_id uuid NOT NULL,
    revision integer NOT NULL,
    fingerprint character varying NOT NULL,
    state character varying NOT NULL,
    message character varying,
    update_job_id uuid,
    software character varying,
    "values" jsonb,
    finished_at timestamp with time zone,
    CONSTRAINT ck_monitor_runs_state CHECK (state IN ('running', 'succeeded', 'failed', 'refused'))
);

CREATE TABLE monitor_series (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    monitor_id uuid NOT NULL,
    number integer NOT NULL,
    software character varying NOT NULL,
    reason character varying NOT NULL,
    digest character varying,
    assessed_at timestamp with time zone,
    document json
);

CREATE TABLE monitors (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    structure_id uuid NOT NULL,
    structure_version_id uuid NOT NULL,
    user_id uuid NOT NULL,
    name character varying NOT NULL,
    boundary character varying,
    recipe jsonb NOT NULL,
    modes character varying NOT NULL,
    priors character varying NOT NULL,
    watch jsonb NOT NULL,
    since timestamp with time zone,
    expected_interval_days double precision,
    runs_on character varying NOT NULL,
    schedule character varying,
    next_run_at timestamp with time zone,
    mail_to jsonb NOT NULL,
    active boolean DEFAULT true NOT NULL,
    series integer DEFAULT 0 NOT NULL,
    state character varying DEFAULT 'no data'::character varying NOT NULL,
    state_rank integer NOT NULL,
    state_since timestamp with time zone DEFAULT now() NOT NULL,
    updated_at timestamp with time zone DEFAULT now() NOT NULL,
    deleted_at timestamp with time zone,
    CONSTRAINT ck_monitors_state CHECK (state IN ('no data', 'normal', 'pending', 'alarm', 'acknowledged'))
);

CREATE TABLE original_chunks (
    sha256 bytea NOT NULL,
    number integer NOT NULL,
    data bytea NOT NULL
)
WITH (toast_tuple_target='8160');
ALTER TABLE original_chunks ALTER COLUMN data SET STORAGE EXTERNAL;

CREATE TABLE originals (
    sha256 bytea NOT NULL,
    size bigint NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL
);

CREATE TABLE processings (
    id uuid NOT NULL,
    campaign_id uuid NOT NULL,
    options jsonb NOT NULL,
    document json
);

CREATE TABLE projects (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    name character varying NOT NULL,
    description character varying DEFAULT ''::character varying NOT NULL,
    updated_at timestamp with time zone DEFAULT now() NOT NULL,
    archived_at timestamp with time zone,
    deleted_at timestamp with time zone,
    tags character varying[] DEFAULT '{}'::character varying[] NOT NULL,
    meta jsonb DEFAULT '{}'::jsonb NOT NULL,
    schemas jsonb DEFAULT '{}'::jsonb NOT NULL
);

CREATE TABLE records (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    campaign_id uuid NOT NULL,
    label character varying NOT NULL,
    filename character varying NOT NULL,
    quantity character varying NOT NULL,
    point bigint NOT NULL,
    direction integer NOT NULL,
    force_point bigint NOT NULL,
    force_direction integer NOT NULL,
    hit bigint NOT NULL,
    sample_rate_hz double precision NOT NULL,
    samples integer NOT NULL,
    sensitivity double precision NOT NULL,
    window_rate_per_s double precision NOT NULL,
    full_scale double precision,
    dtype character varying NOT NULL,
    sha256 bytea NOT NULL,
    data bytea NOT NULL,
    import_id uuid,
    start_sample bigint
);
ALTER TABLE records ALTER COLUMN data SET STORAGE EXTERNAL;

CREATE TABLE saved_searches (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    project_id uuid NOT NULL,
    name character varying NOT NULL,
    noun character varying NOT NULL,
    query jsonb NOT NULL
);

CREATE TABLE stored_bytes (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    project_id uuid NOT NULL,
    structure_id uuid,
    campaign_id uuid,
    kind character varying NOT NULL,
    size bigint NOT NULL
);

CREATE TABLE structure_models (
    id uuid NOT NULL,
    structure_id uuid NOT NULL,
    filename character varying NOT NULL,
    sha256 bytea NOT NULL,
    units character varying,
    accepted jsonb NOT NULL,
    document json,
    arrays bytea,
    arrays_sha256 bytea,
    sections json
);
ALTER TABLE structure_models ALTER COLUMN arrays SET STORAGE EXTERNAL;

CREATE TABLE structure_versions (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    structure_id uuid NOT NULL,
    number integer NOT NULL,
    length_m double precision,
    width_m double precision,
    thickness_m double precision,
    density_kg_m3 double precision,
    laminate jsonb,
    material jsonb,
    inputs jsonb,
    pieces jsonb,
    shape jsonb,
    model uuid
);

CREATE TABLE structures (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    project_id uuid NOT NULL,
    name character varying NOT NULL,
    version integer NOT NULL,
    updated_at timestamp with time zone DEFAULT now() NOT NULL,
    deleted_at timestamp with time zone,
    tags character varying[] DEFAULT '{}'::character varying[] NOT NULL,
    meta jsonb DEFAULT '{}'::jsonb NOT NULL
);

CREATE TABLE update_jobs (
    id uuid NOT NULL,
    project_id uuid NOT NULL,
    campaign_id uuid NOT NULL,
    structure_version_id uuid NOT NULL,
    recipe jsonb NOT NULL,
    idempotency_key character varying
);

CREATE TABLE update_results (
    id uuid NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    document json NOT NULL,
    prediction bytea NOT NULL,
    verdict character varying,
    ex double precision,
    ex_sd double precision,
    ex_low double precision,
    ex_high double precision,
    ey double precision,
    ey_sd double precision,
    ey_low double precision,
    ey_high double precision,
    gxy double precision,
    gxy_sd double precision,
    gxy_low double precision,
    gxy_high double precision,
    gxz double precision,
    gxz_sd double precision,
    gxz_low double precision,
    gxz_high double precision,
    gyz double precision,
    gyz_sd double precision,
    gyz_low double precision,
    gyz_high double precision,
    a0 double precision,
    a0_sd double precision,
    a0_low double precision,
    a0_high double precision,
    a1 double precision,
    a1_sd double precision,
    a1_low double precision,
    a1_high double precision,
    campaign_id uuid NOT NULL,
    tags character varying[] DEFAULT '{}'::character varying[] NOT NULL,
    meta jsonb DEFAULT '{}'::jsonb NOT NULL,
    constants jsonb DEFAULT '{}'::jsonb NOT NULL
);
ALTER TABLE update_results ALTER COLUMN prediction SET STORAGE EXTERNAL;

CREATE TABLE users (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    name character varying NOT NULL,
    disabled_at timestamp with time zone,
    administrator boolean DEFAULT false NOT NULL
);

CREATE TABLE webhooks (
    id uuid DEFAULT uuidv7() NOT NULL,
    created_at timestamp with time zone DEFAULT now() NOT NULL,
    project_id uuid NOT NULL,
    url character varying NOT NULL,
    secret character varying NOT NULL,
    events jsonb NOT NULL,
    active boolean DEFAULT true NOT NULL
);

ALTER TABLE alarm_events ADD CONSTRAINT pk_alarm_events PRIMARY KEY (id);
ALTER TABLE alarms ADD CONSTRAINT pk_alarms PRIMARY KEY (id);
ALTER TABLE api_keys ADD CONSTRAINT pk_api_keys PRIMARY KEY (id);
ALTER TABLE audit_events ADD CONSTRAINT pk_audit_events PRIMARY KEY (id);
ALTER TABLE browser_sessions ADD CONSTRAINT pk_browser_sessions PRIMARY KEY (id);
ALTER TABLE campaign_completions ADD CONSTRAINT pk_campaign_completions PRIMARY KEY (campaign_id);
ALTER TABLE campaigns ADD CONSTRAINT pk_campaigns PRIMARY KEY (id);
ALTER TABLE coupon_batches ADD CONSTRAINT pk_coupon_batches PRIMARY KEY (id);
ALTER TABLE coupon_curves ADD CONSTRAINT pk_coupon_curves PRIMARY KEY (coupon_id);
ALTER TABLE coupons ADD CONSTRAINT pk_coupons PRIMARY KEY (id);
ALTER TABLE deliveries ADD CONSTRAINT pk_deliveries PRIMARY KEY (id);
ALTER TABLE forecasts ADD CONSTRAINT pk_forecasts PRIMARY KEY (id);
ALTER TABLE frfs ADD CONSTRAINT pk_frfs PRIMARY KEY (id);
ALTER TABLE grid_points ADD CONSTRAINT pk_grid_points PRIMARY KEY (campaign_id, label);
ALTER TABLE hit_decisions ADD CONSTRAINT pk_hit_decisions PRIMARY KEY (id);
ALTER TABLE identifications ADD CONSTRAINT pk_identifications PRIMARY KEY (id);
ALTER TABLE imports ADD CONSTRAINT pk_imports PRIMARY KEY (id);
ALTER TABLE instrument_uses ADD CONSTRAINT pk_instrument_uses PRIMARY KEY (campaign_id, number);
ALTER TABLE instruments ADD CONSTRAINT pk_instruments PRIMARY KEY (id);
ALTER TABLE job_checkpoints ADD CONSTRAINT pk_job_checkpoints PRIMARY KEY (job_id);
ALTER TABLE jobs ADD CONSTRAINT pk_jobs PRIMARY KEY (id);
ALTER TABLE joint_updates ADD CONSTRAINT pk_joint_updates PRIMARY KEY (id);
ALTER TABLE members ADD CONSTRAINT pk_members PRIMARY KEY (project_id, user_id);
ALTER TABLE mode_sets ADD CONSTRAINT pk_mode_sets PRIMARY KEY (id);
ALTER TABLE modes ADD CONSTRAINT pk_modes PRIMARY KEY (mode_set_id, number);
ALTER TABLE monitor_assessments ADD CONSTRAINT pk_monitor_assessments PRIMARY KEY (id);
ALTER TABLE monitor_runs ADD CONSTRAINT pk_monitor_runs PRIMARY KEY (id);
ALTER TABLE monitor_series ADD CONSTRAINT pk_monitor_series PRIMARY KEY (id);
ALTER TABLE monitors ADD CONSTRAINT pk_monitors PRIMARY KEY (id);
ALTER TABLE original_chunks ADD CONSTRAINT pk_original_chunks PRIMARY KEY (sha256, number);
ALTER TABLE originals ADD CONSTRAINT pk_originals PRIMARY KEY (sha256);
ALTER TABLE processings ADD CONSTRAINT pk_processings PRIMARY KEY (id);
ALTER TABLE projects ADD CONSTRAINT pk_projects PRIMARY KEY (id);
ALTER TABLE records ADD CONSTRAINT pk_records PRIMARY KEY (id);
ALTER TABLE saved_searches ADD CONSTRAINT pk_saved_searches PRIMARY KEY (id);
ALTER TABLE stored_bytes ADD CONSTRAINT pk_stored_bytes PRIMARY KEY (id);
ALTER TABLE structure_models ADD CONSTRAINT pk_structure_models PRIMARY KEY (id);
ALTER TABLE structure_versions ADD CONSTRAINT pk_structure_versions PRIMARY KEY (id);
ALTER TABLE structures ADD CONSTRAINT pk_structures PRIMARY KEY (id);
ALTER TABLE update_jobs ADD CONSTRAINT pk_update_jobs PRIMARY KEY (id);
ALTER TABLE update_results ADD CONSTRAINT pk_update_results PRIMARY KEY (id);
ALTER TABLE users ADD CONSTRAINT pk_users PRIMARY KEY (id);
ALTER TABLE webhooks ADD CONSTRAINT pk_webhooks PRIMARY KEY (id);
ALTER TABLE api_keys ADD CONSTRAINT uq_api_keys_prefix UNIQUE (prefix);
ALTER TABLE browser_sessions ADD CONSTRAINT uq_browser_sessions_token_sha256 UNIQUE (token_sha256);
ALTER TABLE coupons ADD CONSTRAINT uq_coupons_batch_id_specimen UNIQUE (batch_id, specimen);
ALTER TABLE instruments ADD CONSTRAINT uq_instruments_project_id_kind_serial UNIQUE (project_id, kind, serial);
ALTER TABLE monitor_runs ADD CONSTRAINT uq_monitor_runs_series_id_campaign_id_revision UNIQUE (series_id, campaign_id, revision);
ALTER TABLE monitor_series ADD CONSTRAINT uq_monitor_series_monitor_id_number UNIQUE (monitor_id, number);
ALTER TABLE saved_searches ADD CONSTRAINT uq_saved_searches_project_id_name UNIQUE (project_id, name);
ALTER TABLE structure_versions ADD CONSTRAINT uq_structure_versions_structure_id_number UNIQUE (structure_id, number);
ALTER TABLE users ADD CONSTRAINT uq_users_name UNIQUE (name);

ALTER TABLE alarm_events ADD CONSTRAINT fk_alarm_events_alarm_id_alarms FOREIGN KEY (alarm_id) REFERENCES alarms(id) ON DELETE CASCADE;
ALTER TABLE alarm_events ADD CONSTRAINT fk_alarm_events_user_id_users FOREIGN KEY (user_id) REFERENCES users(id);
ALTER TABLE alarms ADD CONSTRAINT fk_alarms_acknowledged_by_users FOREIGN KEY (acknowledged_by) REFERENCES users(id);
ALTER TABLE alarms ADD CONSTRAINT fk_alarms_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE alarms ADD CONSTRAINT fk_alarms_monitor_id_monitors FOREIGN KEY (monitor_id) REFERENCES monitors(id) ON DELETE CASCADE;
ALTER TABLE api_keys ADD CONSTRAINT fk_api_keys_user_id_users FOREIGN KEY (user_id) REFERENCES users(id) ON DELETE CASCADE;
ALTER TABLE browser_sessions ADD CONSTRAINT fk_browser_sessions_key_id_api_keys FOREIGN KEY (key_id) REFERENCES api_keys(id) ON DELETE CASCADE;
ALTER TABLE campaign_completions ADD CONSTRAINT fk_campaign_completions_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE campaign_completions ADD CONSTRAINT fk_campaign_completions_user_id_users FOREIGN KEY (user_id) REFERENCES users(id);
ALTER TABLE campaigns ADD CONSTRAINT fk_campaigns_structure_id_structures FOREIGN KEY (structure_id) REFERENCES structures(id) ON DELETE CASCADE;
ALTER TABLE coupon_batches ADD CONSTRAINT fk_coupon_batches_structure_id_structures FOREIGN KEY (structure_id) REFERENCES structures(id) ON DELETE CASCADE;
ALTER TABLE coupon_curves ADD CONSTRAINT fk_coupon_curves_coupon_id_coupons FOREIGN KEY (coupon_id) REFERENCES coupons(id) ON DELETE CASCADE;
ALTER TABLE coupons ADD CONSTRAINT fk_coupons_batch_id_coupon_batches FOREIGN KEY (batch_id) REFERENCES coupon_batches(id) ON DELETE CASCADE;
ALTER TABLE deliveries ADD CONSTRAINT fk_deliveries_monitor_id_monitors FOREIGN KEY (monitor_id) REFERENCES monitors(id) ON DELETE CASCADE;
ALTER TABLE deliveries ADD CONSTRAINT fk_deliveries_project_id_projects FOREIGN KEY (project_id) REFERENCES projects(id) ON DELETE CASCADE;
ALTER TABLE deliveries ADD CONSTRAINT fk_deliveries_webhook_id_webhooks FOREIGN KEY (webhook_id) REFERENCES webhooks(id) ON DELETE CASCADE;
ALTER TABLE forecasts ADD CONSTRAINT fk_forecasts_id_jobs FOREIGN KEY (id) REFERENCES jobs(id) DEFERRABLE;
ALTER TABLE forecasts ADD CONSTRAINT fk_forecasts_structure_id_structures FOREIGN KEY (structure_id) REFERENCES structures(id) ON DELETE CASCADE;
ALTER TABLE forecasts ADD CONSTRAINT fk_forecasts_structure_version_id_structure_versions FOREIGN KEY (structure_version_id) REFERENCES structure_versions(id) DEFERRABLE;
ALTER TABLE frfs ADD CONSTRAINT fk_frfs_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE frfs ADD CONSTRAINT fk_frfs_import_id_imports FOREIGN KEY (import_id) REFERENCES imports(id) DEFERRABLE;
ALTER TABLE frfs ADD CONSTRAINT fk_frfs_processing_id_processings FOREIGN KEY (processing_id) REFERENCES processings(id);
ALTER TABLE grid_points ADD CONSTRAINT fk_grid_points_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE hit_decisions ADD CONSTRAINT fk_hit_decisions_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE identifications ADD CONSTRAINT fk_identifications_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE identifications ADD CONSTRAINT fk_identifications_id_jobs FOREIGN KEY (id) REFERENCES jobs(id) DEFERRABLE;
ALTER TABLE imports ADD CONSTRAINT fk_imports_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE imports ADD CONSTRAINT fk_imports_id_jobs FOREIGN KEY (id) REFERENCES jobs(id) DEFERRABLE;
ALTER TABLE imports ADD CONSTRAINT fk_imports_sha256_originals FOREIGN KEY (sha256) REFERENCES originals(sha256);
ALTER TABLE instrument_uses ADD CONSTRAINT fk_instrument_uses_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE instrument_uses ADD CONSTRAINT fk_instrument_uses_instrument_id_instruments FOREIGN KEY (instrument_id) REFERENCES instruments(id) ON DELETE SET NULL;
ALTER TABLE instruments ADD CONSTRAINT fk_instruments_project_id_projects FOREIGN KEY (project_id) REFERENCES projects(id) ON DELETE CASCADE;
ALTER TABLE job_checkpoints ADD CONSTRAINT fk_job_checkpoints_job_id_jobs FOREIGN KEY (job_id) REFERENCES jobs(id) ON DELETE CASCADE;
ALTER TABLE jobs ADD CONSTRAINT fk_jobs_project_id_projects FOREIGN KEY (project_id) REFERENCES projects(id) ON DELETE CASCADE;
ALTER TABLE joint_updates ADD CONSTRAINT fk_joint_updates_id_jobs FOREIGN KEY (id) REFERENCES jobs(id) DEFERRABLE;
ALTER TABLE joint_updates ADD CONSTRAINT fk_joint_updates_project_id_projects FOREIGN KEY (project_id) REFERENCES projects(id) ON DELETE CASCADE;
ALTER TABLE members ADD CONSTRAINT fk_members_project_id_projects FOREIGN KEY (project_id) REFERENCES projects(id) ON DELETE CASCADE;
ALTER TABLE members ADD CONSTRAINT fk_members_user_id_users FOREIGN KEY (user_id) REFERENCES users(id) ON DELETE CASCADE;
ALTER TABLE mode_sets ADD CONSTRAINT fk_mode_sets_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE mode_sets ADD CONSTRAINT fk_mode_sets_import_id_imports FOREIGN KEY (import_id) REFERENCES imports(id) DEFERRABLE;
ALTER TABLE mode_sets ADD CONSTRAINT fk_mode_sets_job_id_jobs FOREIGN KEY (job_id) REFERENCES jobs(id) ON DELETE SET NULL;
ALTER TABLE modes ADD CONSTRAINT fk_modes_mode_set_id_mode_sets FOREIGN KEY (mode_set_id) REFERENCES mode_sets(id) ON DELETE CASCADE;
ALTER TABLE monitor_assessments ADD CONSTRAINT fk_monitor_assessments_id_jobs FOREIGN KEY (id) REFERENCES jobs(id) DEFERRABLE;
ALTER TABLE monitor_assessments ADD CONSTRAINT fk_monitor_assessments_series_id_monitor_series FOREIGN KEY (series_id) REFERENCES monitor_series(id) ON DELETE CASCADE;
ALTER TABLE monitor_runs ADD CONSTRAINT fk_monitor_runs_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE monitor_runs ADD CONSTRAINT fk_monitor_runs_series_id_monitor_series FOREIGN KEY (series_id) REFERENCES monitor_series(id) ON DELETE CASCADE;
ALTER TABLE monitor_runs ADD CONSTRAINT fk_monitor_runs_update_job_id_update_jobs FOREIGN KEY (update_job_id) REFERENCES update_jobs(id) DEFERRABLE;
ALTER TABLE monitor_series ADD CONSTRAINT fk_monitor_series_monitor_id_monitors FOREIGN KEY (monitor_id) REFERENCES monitors(id) ON DELETE CASCADE;
ALTER TABLE monitors ADD CONSTRAINT fk_monitors_structure_id_structures FOREIGN KEY (structure_id) REFERENCES structures(id) ON DELETE CASCADE;
ALTER TABLE monitors ADD CONSTRAINT fk_monitors_structure_version_id_structure_versions FOREIGN KEY (structure_version_id) REFERENCES structure_versions(id) DEFERRABLE;
ALTER TABLE monitors ADD CONSTRAINT fk_monitors_user_id_users FOREIGN KEY (user_id) REFERENCES users(id);
ALTER TABLE original_chunks ADD CONSTRAINT fk_original_chunks_sha256_originals FOREIGN KEY (sha256) REFERENCES originals(sha256) ON DELETE CASCADE;
ALTER TABLE processings ADD CONSTRAINT fk_processings_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE processings ADD CONSTRAINT fk_processings_id_jobs FOREIGN KEY (id) REFERENCES jobs(id) DEFERRABLE;
ALTER TABLE records ADD CONSTRAINT fk_records_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE records ADD CONSTRAINT fk_records_import_id_imports FOREIGN KEY (import_id) REFERENCES imports(id) DEFERRABLE;
ALTER TABLE saved_searches ADD CONSTRAINT fk_saved_searches_project_id_projects FOREIGN KEY (project_id) REFERENCES projects(id) ON DELETE CASCADE;
ALTER TABLE stored_bytes ADD CONSTRAINT fk_stored_bytes_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE stored_bytes ADD CONSTRAINT fk_stored_bytes_project_id_projects FOREIGN KEY (project_id) REFERENCES projects(id) ON DELETE CASCADE;
ALTER TABLE stored_bytes ADD CONSTRAINT fk_stored_bytes_structure_id_structures FOREIGN KEY (structure_id) REFERENCES structures(id) ON DELETE CASCADE;
ALTER TABLE structure_models ADD CONSTRAINT fk_structure_models_id_jobs FOREIGN KEY (id) REFERENCES jobs(id) DEFERRABLE;
ALTER TABLE structure_models ADD CONSTRAINT fk_structure_models_sha256_originals FOREIGN KEY (sha256) REFERENCES originals(sha256);
ALTER TABLE structure_models ADD CONSTRAINT fk_structure_models_structure_id_structures FOREIGN KEY (structure_id) REFERENCES structures(id) ON DELETE CASCADE;
ALTER TABLE structure_versions ADD CONSTRAINT fk_structure_versions_model_structure_models FOREIGN KEY (model) REFERENCES structure_models(id) DEFERRABLE;
ALTER TABLE structure_versions ADD CONSTRAINT fk_structure_versions_structure_id_structures FOREIGN KEY (structure_id) REFERENCES structures(id) ON DELETE CASCADE;
ALTER TABLE structures ADD CONSTRAINT fk_structures_project_id_projects FOREIGN KEY (project_id) REFERENCES projects(id) ON DELETE CASCADE;
ALTER TABLE update_jobs ADD CONSTRAINT fk_update_jobs_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE update_jobs ADD CONSTRAINT fk_update_jobs_id_jobs FOREIGN KEY (id) REFERENCES jobs(id) DEFERRABLE;
ALTER TABLE update_jobs ADD CONSTRAINT fk_update_jobs_project_id_projects FOREIGN KEY (project_id) REFERENCES projects(id) ON DELETE CASCADE;
ALTER TABLE update_jobs ADD CONSTRAINT fk_update_jobs_structure_version_id_structure_versions FOREIGN KEY (structure_version_id) REFERENCES structure_versions(id) DEFERRABLE;
ALTER TABLE update_results ADD CONSTRAINT fk_update_results_campaign_id_campaigns FOREIGN KEY (campaign_id) REFERENCES campaigns(id) ON DELETE CASCADE;
ALTER TABLE update_results ADD CONSTRAINT fk_update_results_id_update_jobs FOREIGN KEY (id) REFERENCES update_jobs(id) ON DELETE CASCADE;
ALTER TABLE webhooks ADD CONSTRAINT fk_webhooks_project_id_projects FOREIGN KEY (project_id) REFERENCES projects(id) ON DELETE CASCADE;

CREATE FUNCTION audit_is_kept() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
  RAISE EXCEPTION 'the audit trail is not changed' USING ERRCODE = 'insufficient_privilege';
END $$;

CREATE FUNCTION campaign_stated() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
  PERFORM pg_advisory_xact_lock_shared(hashtextextended(project_id::text, 47)) FROM structures WHERE id = NEW.structure_id;
  PERFORM state_uses(ARRAY[NEW.id]);
  RETURN NULL;
END $$;

CREATE FUNCTION instrument_stated() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
  PERFORM pg_advisory_xact_lock(hashtextextended(NEW.project_id::text, 47));
  PERFORM state_uses(ARRAY(
    SELECT campaign_id FROM instrument_uses WHERE instrument_id = NEW.id
    UNION
    SELECT campaign_id FROM instrument_uses AS u
      JOIN campaigns ON campaigns.id = campaign_id JOIN structures ON structures.id = structure_id
    WHERE u.serial = NEW.serial AND u.kind = NEW.kind AND project_id = NEW.project_id));
  RETURN NULL;
END $$;

CREATE FUNCTION job_changed() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
  IF (NEW.state, NEW.stage, NEW.progress, NEW.message, NEW.attempt, NEW.cancel_requested)
     IS DISTINCT FROM (OLD.state, OLD.stage, OLD.progress, OLD.message, OLD.attempt, OLD.cancel_requested) THEN
    NEW.version := OLD.version + 1;
    PERFORM pg_notify('modalbase_job_changed', NEW.id::text);
  END IF;
  RETURN NEW;
END $$;

CREATE FUNCTION job_deleted() RETURNS trigger
    LANGUAGE plpgsql
    AS $$
BEGIN
  DELETE FROM procrastinate_jobs WHERE id = OLD.ticket;
  RETURN NULL;
END $$;

CREATE FUNCTION refuse_change() RETURNS trigger
    LANGUAGE plpgsql
    AS $$ BEGIN RAISE EXCEPTION 'rows of % never change', TG_TABLE_NAME; END $$;

CREATE FUNCTION state_uses(keys uuid[]) RETURNS void
    LANGUAGE sql
    AS $_$
DELETE FROM instrument_uses WHERE campaign_id = ANY (keys);
INSERT INTO instrument_uses (campaign_id, number, kind, serial, model, points, others,
    instrument_id, calibrated_on, calibrated_until, calibration_expired)
SELECT c.id, row_number() OVER (PARTITION BY c.id), u.kind, u.serial, u.model, u.points, u.others,
  i.id, k.performed_on, k.valid_until, c.tested > k.valid_until
FROM (
  SELECT campaigns.id, project_id, instruments AS stated, (performed_at AT TIME ZONE 'UTC')::date AS tested
  FROM campaigns JOIN structures ON structures.id = structure_id WHERE campaigns.id = ANY (keys)
) AS c
CROSS JOIN LATERAL (
  SELECT kind, stated -> kind ->> 'serial' AS serial, stated -> kind ->> 'model' AS model, NULL::bigint[] AS points,
    ARRAY(SELECT jsonb_path_query(stated, '$.sensors[*].points[*]')::bigint WHERE kind = 'sensor') AS others
  FROM unnest(ARRAY['hammer', 'sensor', 'analyser']) AS kind
  UNION ALL
  SELECT 'sensor', s ->> 'serial', s ->> 'model', ARRAY(SELECT jsonb_array_elements(s -> 'points')::bigint), '{}'
  FROM jsonb_path_query(stated, '$.sensors[*]') AS s
) AS u
LEFT JOIN instruments AS i ON i.project_id = c.project_id AND i.kind = u.kind AND i.serial = u.serial
LEFT JOIN LATERAL (
  SELECT performed_on, valid_until FROM jsonb_to_recordset(i.calibrations) AS (performed_on date, valid_until date)
  WHERE performed_on <= c.tested ORDER BY performed_on DESC LIMIT 1
) AS k ON true
WHERE coalesce(u.serial, u.model) IS NOT NULL
$_$;

CREATE INDEX ix_alarm_events_alarm_id_id ON alarm_events USING btree (alarm_id, id);
CREATE INDEX ix_alarms_monitor_id_id ON alarms USING btree (monitor_id, id);
CREATE UNIQUE INDEX ix_alarms_raised_once ON alarms USING btree (monitor_id, parameter, campaign_id) WHERE ((state)::text <> 'withdrawn'::text);
CREATE INDEX ix_api_keys_user_id ON api_keys USING btree (user_id);
CREATE INDEX ix_audit_events_project_id_id ON audit_events USING btree (project_id, id);
CREATE INDEX ix_audit_events_user_id_id ON audit_events USING btree (user_id, id);
CREATE INDEX ix_browser_sessions_key_id ON browser_sessions USING btree (key_id);
CREATE INDEX ix_campaigns_meta ON campaigns USING gin (meta) WHERE (meta <> '{}'::jsonb);
CREATE INDEX ix_campaigns_performed_at ON campaigns USING btree (performed_at);
CREATE INDEX ix_campaigns_structure_id_id ON campaigns USING btree (structure_id, id);
CREATE INDEX ix_campaigns_tags ON campaigns USING gin (tags) WHERE (tags <> '{}'::character varying[]);
CREATE INDEX ix_campaigns_words ON campaigns USING gin (((to_tsvector('simple'::regconfig, (((name)::text || ' '::text) || (notes)::text)) || jsonb_to_tsvector('simple'::regconfig, instruments, '["string", "numeric"]'::jsonb))));
CREATE INDEX ix_coupon_batches_structure_id_id ON coupon_batches USING btree (structure_id, id);
CREATE INDEX ix_deliveries_due ON deliveries USING btree (due_at) WHERE ((state)::text = 'waiting'::text);
CREATE INDEX ix_deliveries_monitor_id_id ON deliveries USING btree (monitor_id, id);
CREATE INDEX ix_deliveries_webhook_id_id ON deliveries USING btree (webhook_id, id);
CREATE INDEX ix_forecasts_structure_id_id ON forecasts USING btree (structure_id, id);
CREATE INDEX ix_frfs_campaign_id_id ON frfs USING btree (campaign_id, id);
CREATE INDEX ix_frfs_campaign_id_response_point_id ON frfs USING btree (campaign_id, response_point, id);
CREATE INDEX ix_frfs_driving_point ON frfs USING btree (campaign_id, id) WHERE ((response_point = reference_point) AND (abs(response_direction) = abs(reference_direction)));
CREATE UNIQUE INDEX ix_frfs_import_id_dataset ON frfs USING btree (import_id, dataset);
CREATE INDEX ix_frfs_meta ON frfs USING gin (meta) WHERE (meta <> '{}'::jsonb);
CREATE INDEX ix_frfs_processing_id ON frfs USING btree (processing_id);
CREATE INDEX ix_frfs_reference_point_id ON frfs USING btree (reference_point, id);
CREATE INDEX ix_frfs_tags ON frfs USING gin (tags) WHERE (tags <> '{}'::character varying[]);
CREATE INDEX ix_hit_decisions_campaign_id_id ON hit_decisions USING btree (campaign_id, id);
CREATE INDEX ix_identifications_campaign_id_id ON identifications USING btree (campaign_id, id);
CREATE INDEX ix_imports_campaign_id_sha256 ON imports USING btree (campaign_id, sha256);
CREATE INDEX ix_instrument_uses_expired ON instrument_uses USING btree (campaign_id) WHERE calibration_expired;
CREATE INDEX ix_instrument_uses_instrument_id ON instrument_uses USING btree (instrument_id);
CREATE INDEX ix_instrument_uses_model ON instrument_uses USING btree (model);
CREATE INDEX ix_instrument_uses_serial ON instrument_uses USING btree (serial);
CREATE INDEX ix_jobs_project_id_id ON jobs USING btree (project_id, id);
CREATE INDEX ix_jobs_project_id_started_at ON jobs USING btree (project_id, started_at);
CREATE INDEX ix_jobs_queued ON jobs USING btree (queue, project_id, losses, priority DESC, id) WHERE ((state)::text = 'queued'::text);
CREATE INDEX ix_jobs_running_project_id ON jobs USING btree (project_id) WHERE ((state)::text = 'running'::text);
CREATE UNIQUE INDEX ix_joint_updates_project_id_idempotency_key ON joint_updates USING btree (project_id, idempotency_key);
CREATE INDEX ix_members_user_id ON members USING btree (user_id);
CREATE INDEX ix_mode_sets_campaign_id_id ON mode_sets USING btree (campaign_id, id);
CREATE INDEX ix_modes_frequency_hz ON modes USING btree (frequency_hz);
CREATE INDEX ix_monitor_assessments_series_id_id ON monitor_assessments USING btree (series_id, id);
CREATE INDEX ix_monitor_runs_running ON monitor_runs USING btree (update_job_id) WHERE ((state)::text = 'running'::text);
CREATE INDEX ix_monitors_state_rank_id ON monitors USING btree (state_rank, id);
CREATE INDEX ix_monitors_structure_id_id ON monitors USING btree (structure_id, id);
CREATE INDEX ix_processings_campaign_id_id ON processings USING btree (campaign_id, id);
CREATE INDEX ix_projects_meta ON projects USING gin (meta) WHERE (meta <> '{}'::jsonb);
CREATE INDEX ix_projects_tags ON projects USING gin (tags) WHERE (tags <> '{}'::character varying[]);
CREATE INDEX ix_records_campaign_id_id ON records USING btree (campaign_id, id);
CREATE UNIQUE INDEX ix_records_hit ON records USING btree (campaign_id, force_point, force_direction, hit, quantity, point, direction);
CREATE INDEX ix_records_import_id ON records USING btree (import_id);
CREATE INDEX ix_stored_bytes_campaign_id ON stored_bytes USING btree (campaign_id);
CREATE INDEX ix_stored_bytes_project_id_kind_size ON stored_bytes USING btree (project_id, kind, size);
CREATE INDEX ix_stored_bytes_structure_id ON stored_bytes USING btree (structure_id);
CREATE INDEX ix_structure_models_structure_id_id ON structure_models USING btree (structure_id, id);
CREATE INDEX ix_structures_meta ON structures USING gin (meta) WHERE (meta <> '{}'::jsonb);
CREATE INDEX ix_structures_project_id_id ON structures USING btree (project_id, id);
CREATE INDEX ix_structures_tags ON structures USING gin (tags) WHERE (tags <> '{}'::character varying[]);
CREATE INDEX ix_structures_words ON structures USING gin (to_tsvector('simple'::regconfig, (name)::text));
CREATE INDEX ix_update_jobs_campaign_id_id ON update_jobs USING btree (campaign_id, id);
CREATE UNIQUE INDEX ix_update_jobs_project_id_idempotency_key ON update_jobs USING btree (project_id, idempotency_key);
CREATE INDEX ix_update_results_a0 ON update_results USING btree (a0);
CREATE INDEX ix_update_results_a1 ON update_results USING btree (a1);
CREATE INDEX ix_update_results_campaign_id ON update_results USING btree (campaign_id);
CREATE INDEX ix_update_results_ex ON update_results USING btree (ex);
CREATE INDEX ix_update_results_ey ON update_results USING btree (ey);
CREATE INDEX ix_update_results_gxy ON update_results USING btree (gxy);
CREATE INDEX ix_update_results_gxz ON update_results USING btree (gxz);
CREATE INDEX ix_update_results_gyz ON update_results USING btree (gyz);
CREATE INDEX ix_update_results_meta ON update_results USING gin (meta) WHERE (meta <> '{}'::jsonb);
CREATE INDEX ix_update_results_tags ON update_results USING gin (tags) WHERE (tags <> '{}'::character varying[]);
CREATE INDEX ix_webhooks_project_id_id ON webhooks USING btree (project_id, id);

CREATE TRIGGER audit_is_kept BEFORE DELETE OR UPDATE OR TRUNCATE ON audit_events FOR EACH STATEMENT EXECUTE FUNCTION audit_is_kept();
CREATE TRIGGER campaign_stated AFTER INSERT OR UPDATE OF instruments, performed_at ON campaigns FOR EACH ROW EXECUTE FUNCTION campaign_stated();
CREATE TRIGGER instrument_stated AFTER INSERT OR UPDATE OF serial, calibrations ON instruments FOR EACH ROW EXECUTE FUNCTION instrument_stated();
CREATE TRIGGER job_changed BEFORE UPDATE ON jobs FOR EACH ROW EXECUTE FUNCTION job_changed();
CREATE TRIGGER job_deleted AFTER DELETE ON jobs FOR EACH ROW EXECUTE FUNCTION job_deleted();
CREATE TRIGGER structure_versions_never_change BEFORE UPDATE ON structure_versions FOR EACH ROW EXECUTE FUNCTION refuse_change();
