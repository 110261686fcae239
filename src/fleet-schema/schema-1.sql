-- Tasks and resources that robots share: version 1 of the schema.
--
-- The functions are the contract: a client in any language calls them, and needs no table. They decide by the clock of
-- the database (fleet.clock), by row locks and by transactions. What one of them refuses, it refuses with an exception:
--
--   FL001  the lease is lost: the task was started again, or has ended
--   FL002  an argument is not allowed
--   FL003  the database was restored from a copy, and fleet.new_epoch was not run
--
-- A task is later (its time has not come), waiting, running, done, dead or cancelled. Each start of a task has a
-- lease, and each hold of a resource has a fence: numbers that only grow. What is said about a start names its task
-- and its lease.
--
-- NOTIFY fleet wakes clients, and nothing depends on it: 'queue NAME' (a task waits), 'later NAME' (the clock will make
-- one wait), 'task NUMBER' (of those that were looked at), 'cancel NUMBER', 'turn REQUEST' (it may have its resources),
-- 'line NAME' (another may have that resource), 'resource NAME' (who waits for it may have it).

create schema fleet;

create type fleet.state as enum ('later', 'waiting', 'running', 'done', 'dead', 'cancelled');

-- The clock of all leases. (Tests replace it.)
create function fleet.clock() returns timestamptz language sql volatile as 'select clock_timestamp()';

-- Which database this is: what one that was restored from a dump does not have. (A copy of the server's files has it:
-- then a client notices that has seen a greater number.)
create function fleet.origin() returns text language sql stable as $$
  select concat_ws('/', system_identifier, (select oid from pg_database where datname = current_database()),
    to_regclass('fleet.about')::oid)
  from pg_control_system()
$$;

-- One row.
create table fleet.about (
  version int not null,
  epoch bigint not null,
  origin text not null,
  home oid not null,                                    -- of this table: another one after a dump was restored
  is_restored boolean not null default false,
  seen bigint not null default 0,                       -- the greatest number that a client has seen of a lost database
  holds_from timestamptz not null default '-infinity',  -- no resource is free before
  is_only boolean primary key default true check (is_only)
);

-- Of all leases and fences. They only grow, also from one epoch to the next: an epoch is a number of seconds since
-- 2026, its numbers begin with a million times that, and there are never a million in a second. (So they are exact in
-- JSON, until 2311.)
create sequence fleet.number;

create function fleet.epoch_at(at timestamptz) returns bigint language sql immutable as $$
  select floor(extract(epoch from at - timestamptz '2026-01-01 00:00 UTC'))::bigint
$$;

create function fleet.refuse(code text, why text) returns void language plpgsql as $$
begin
  raise exception using errcode = code, message = why;
end $$;

-- Wakes who waits for this.
create function fleet.tell(kind text, name text) returns void language sql as $$
  select pg_notify('fleet', kind || ' ' || name)
$$;

-- Refuses what would give out numbers again that were given out before.
create function fleet.require_epoch() returns void language plpgsql as $$
begin
  if (select is_restored or home <> 'fleet.about'::regclass::oid from fleet.about) then
    perform fleet.refuse('FL003', 'this database was restored from a copy: run behavior-fleet new-epoch, when none of '
      || 'the robots that used the other one runs');
  end if;
end $$;

create function fleet.check_robots(names text[]) returns void language plpgsql as $$
begin
  if names is null or exists (select from unnest(names) name where (length(name) between 1 and 200) is not true) then
    perform fleet.refuse('FL002', 'the name of a robot has 1 to 200 characters');
  end if;
end $$;

-- To be called first on each connection, with the greatest number that the client has seen: the version of the schema,
-- and the epoch.
create function fleet.connect(a_number bigint default 0, out version int, out epoch bigint) language plpgsql as $$
declare
  latest bigint := (select last_value from fleet.number);
begin
  if a_number > latest and a_number / 1000000 > fleet.epoch_at(fleet.clock() + interval '1 day') then
    perform fleet.refuse('FL002', format('no database can have given the number %s yet', a_number));
  end if;
  update fleet.about set is_restored = true, seen = greatest(seen, a_number)
  where (origin <> fleet.origin() or latest < a_number) and (not is_restored or seen < a_number);
  select a.version, a.epoch into version, epoch from fleet.about a;
end $$;

-- --- Tasks --------------------------------------------------------------------------------------------------------

create table fleet.task (
  task bigint generated always as identity primary key,
  queue text not null,
  key text not null,             -- the submitter's
  series text,                   -- the submitter's key, if there is a period
  state fleet.state not null,
  priority int not null,         -- the largest first
  needs text[] not null,         -- sorted, each once
  input jsonb not null,
  due timestamptz not null,      -- not started before
  deadline timestamptz,          -- not started after
  period interval,
  pauses interval[] not null,    -- before each further start: there is one start more than pauses
  kept interval not null,        -- after its end
  starts int not null default 0,
  lease bigint,                  -- of the last start
  robot text,                    -- of the last start
  term interval,                 -- of the last start
  request uuid,                  -- of the last start
  wakes timestamptz,             -- when the clock changes its state
  is_cancelled boolean not null default false,
  is_watched boolean not null default false,
  progress jsonb,
  result jsonb,
  reasons jsonb not null default '[]',
  submitted timestamptz not null,
  ended timestamptz,
  unique nulls not distinct (queue, key, series)
);

create index task_waiting on fleet.task (queue, needs, priority desc, task) where state = 'waiting';
create index task_wakes on fleet.task (wakes) where wakes is not null and state in ('later', 'waiting', 'running');
create index task_kept on fleet.task (wakes) where wakes is not null and state in ('done', 'cancelled');
create index task_running on fleet.task (task) where state = 'running';
create index task_dead on fleet.task (queue, task) where state = 'dead';
create index task_of_series on fleet.task (queue, series) where series is not null;
create unique index task_series on fleet.task (queue, series)
  where series is not null and state in ('later', 'waiting', 'running');

-- The key of one task of a series.
create function fleet.key_at(a_key text, at timestamptz) returns text language sql stable as $$
  select a_key || '@' || to_char(at at time zone 'UTC', 'YYYY-MM-DD"T"HH24:MI:SS.US"Z"')
$$;

-- The task that has this key; of periodic ones, the one that is to come or runs, or has this full key, or was
-- cancelled.
create function fleet.find(a_queue text, a_key text, full_key text) returns fleet.task language sql as $$
  select * from fleet.task
  where queue = a_queue and (
    (key = a_key and series is null) or
    (series = a_key and (key = full_key or state in ('later', 'waiting', 'running', 'cancelled'))))
  order by state in ('later', 'waiting', 'running') desc, key = full_key desc, task desc limit 1
$$;

-- The number of the task, if it is the same as what is submitted.
create function fleet.same(t fleet.task, an_input jsonb, a_period interval) returns bigint language plpgsql as $$
begin
  if t.input is distinct from an_input or t.period is distinct from a_period then
    perform fleet.refuse('FL002', format('the key %L of the queue %L is that of a task with another input or period',
      coalesce(t.series, t.key), t.queue));
  end if;
  return t.task;
end $$;

-- A task, as it was submitted first: the same key again is the same task. With a period, one of its tasks is to come
-- at any time, and the key is that of all of them.
create function fleet.submit(
  a_queue text, a_key text, an_input jsonb,
  a_priority int default 0, a_due timestamptz default null, a_deadline timestamptz default null,
  some_needs text[] default '{}', a_period interval default null,
  some_pauses interval[] default '{1s,10s,1min,10min}', a_kept interval default '7 days'
) returns bigint language plpgsql as $$
declare
  at timestamptz := fleet.clock();
begin
  perform fleet.require_epoch();
  case
    when a_queue is null or length(a_queue) not between 1 and 200 then
      perform fleet.refuse('FL002', 'the name of a queue has 1 to 200 characters');
    when a_key is null or length(a_key) not between 1 and 200 then
      perform fleet.refuse('FL002', 'a key has 1 to 200 characters');
    when an_input is null then perform fleet.refuse('FL002', 'a task has an input (it may be the JSON null)');
    when a_priority is null then perform fleet.refuse('FL002', 'a task has a priority (0 by default)');
    when a_period < interval '1 s' or a_period > interval '10 years' then
      perform fleet.refuse('FL002', 'a period has 1 second to 10 years');
    when some_pauses is null or exists (
        select from unnest(some_pauses) pause where (pause between interval '0' and '10 years') is not true) then
      perform fleet.refuse('FL002', 'a pause has 0 seconds to 10 years');
    when cardinality(some_pauses) > 1000 then perform fleet.refuse('FL002', 'there are at most 1000 pauses');
    when a_kept is null or a_kept < interval '0' or a_kept > interval '100 years' then
      perform fleet.refuse('FL002', 'a task is kept for 0 seconds to 100 years');
    when not isfinite(coalesce(a_due, at)) or not isfinite(coalesce(a_deadline, at))
        or greatest(a_due, a_deadline) > at + interval '100 years' then
      perform fleet.refuse('FL002', 'a task is due, and has its deadline, within 100 years');
    when some_needs is null or array_position(some_needs, null) is not null or cardinality(some_needs) > 20
        or exists (select from unnest(some_needs) need where length(need) not between 1 and 50)
        or octet_length(array_to_string(some_needs, '')) > 1500 then
      perform fleet.refuse('FL002', 'there are at most 20 needs, each of 1 to 50 characters, of 1500 bytes together');
    else null;
  end case;
  return fleet.enter(a_queue, a_key, an_input, a_priority, a_due, a_deadline, array(select distinct unnest(some_needs)
    order by 1), a_period, array(select unnest(some_pauses)), a_kept);
end $$;

-- The same, of what is allowed.
create function fleet.enter(
  a_queue text, a_key text, an_input jsonb, a_priority int, a_due timestamptz, a_deadline timestamptz,
  some_needs text[], a_period interval, some_pauses interval[], a_kept interval
) returns bigint language plpgsql as $$
declare
  at timestamptz := fleet.clock();
  a_state fleet.state := case when a_due > at then 'later' else 'waiting' end;
  full_key text := case when a_period is null then a_key else fleet.key_at(a_key, coalesce(a_due, at)) end;
  t fleet.task;
begin
  loop
    t := fleet.find(a_queue, a_key, full_key);
    if t.task is not null then return fleet.same(t, an_input, a_period); end if;
    insert into fleet.task (
      queue, key, series, state, priority, needs, input, due, deadline, period, pauses, kept, submitted, wakes)
    values (
      a_queue, full_key, case when a_period is not null then a_key end, a_state, a_priority, some_needs, an_input,
      coalesce(a_due, at), a_deadline, a_period, some_pauses, a_kept, at,
      case when a_state = 'later' then a_due else a_deadline end)
    on conflict do nothing returning * into t;
    exit when found;
    -- (Someone else has submitted it just now.)
  end loop;
  perform fleet.tell(case a_state when 'later' then 'later' else 'queue' end, a_queue);
  return t.task;
end $$;

-- A start has ended without a completion. (Its row is locked.)
create function fleet.start_ended(t fleet.task, why text, counts boolean) returns void language plpgsql as $$
declare
  at timestamptz := fleet.clock();
  so_far int := t.starts - case when counts then 0 else 1 end;
  again timestamptz := at + case when counts then coalesce(t.pauses[so_far], '0') else '0' end;
  reason jsonb := jsonb_build_object(
    'start', t.starts, 'robot', t.robot, 'at', at, 'reason', left(coalesce(why, ''), 1000));
begin
  if t.is_cancelled then
    perform fleet.close(t, 'cancelled', null, reason);
  elsif so_far > cardinality(t.pauses) then
    perform fleet.close(t, 'dead', null, reason);
  else
    update fleet.task set
      state = case when again > at then 'later' else 'waiting' end::fleet.state,
      starts = so_far, wakes = case when again > at then again else t.deadline end,
      reasons = case when counts then t.reasons || reason else t.reasons end
    where task = t.task;
    perform fleet.tell(case when again > at then 'later' else 'queue' end, t.queue);
  end if;
  if t.is_watched then perform fleet.tell('task', t.task::text); end if;
end $$;

-- The first of the times of a series that is to come. (Days and months are those of UTC.)
create function fleet.next_time(due timestamptz, period interval, at timestamptz) returns timestamptz language plpgsql
as $$
declare
  -- (A month is longer than the 30 days that it counts here.)
  about float8 := extract(epoch from at - due) / extract(epoch from period) * case
    when period >= '28 days' then 0.95 else 1 end;
  n bigint := greatest(1, ceil(about) - case when period >= '28 days' then 1 else 0 end);
  it timestamptz;
begin
  loop
    it := ((due at time zone 'UTC') + n * period) at time zone 'UTC';
    exit when it >= at;
    n := n + 1;
  end loop;
  return it;
end $$;

-- A task has ended. (Its row is locked.) One that is periodic is followed by the next one, at the first of its times
-- that is to come.
create function fleet.close(t fleet.task, a_state fleet.state, a_result jsonb, reason jsonb) returns void
language plpgsql as $$
declare
  at timestamptz := fleet.clock();
  next timestamptz;
begin
  update fleet.task set
    state = a_state, result = a_result, ended = at, wakes = case when a_state <> 'dead' then at + t.kept end,
    reasons = case when reason is null then t.reasons else t.reasons || reason end
  where task = t.task;
  if t.is_watched then perform fleet.tell('task', t.task::text); end if;
  if t.period is not null and a_state <> 'cancelled' and not t.is_cancelled then
    next := fleet.next_time(t.due, t.period, at);
    while exists (
      select from fleet.task where queue = t.queue and series = t.series and key = fleet.key_at(t.series, next))
    loop
      next := fleet.next_time(next, t.period, at);
    end loop;
    perform fleet.enter(t.queue, t.series, t.input, t.priority, next, next + (t.deadline - t.due), t.needs, t.period,
      t.pauses, t.kept);
  end if;
end $$;

-- The clock has made this task due. (Its row is locked.)
create function fleet.wake(t fleet.task, at timestamptz) returns void language plpgsql as $$
begin
  if t.state = 'running' then
    perform fleet.start_ended(t, 'its lease has expired', true);
  elsif t.deadline <= at then
    perform fleet.close(t, 'dead', null,
      jsonb_build_object('start', t.starts, 'at', at, 'reason', 'its deadline has passed'));
  else
    update fleet.task set state = 'waiting', wakes = deadline where task = t.task;
    perform fleet.tell('queue', t.queue);
  end if;
end $$;

-- Does what the clock has made due, 100 tasks at a time: for how many, and the seconds until the next one is due. (A
-- task with which that is not possible is dead, and keeps no other from its turn.)
create function fleet.sweep(out swept int, out next_in double precision)
language plpgsql set lock_timeout = '250ms' as $$
declare
  at timestamptz := fleet.clock();
  removed int;
  t fleet.task;
begin
  swept := 0;
  for t in
    select * from fleet.task where wakes <= at and state in ('later', 'waiting', 'running')
    order by wakes, task limit 100 for update skip locked
  loop
    swept := swept + 1;
    begin
      perform fleet.wake(t, at);
    exception
    -- (A lock that is not free, a database that is ended: it is due still.)
    when transaction_rollback or insufficient_resources or lock_not_available or operator_intervention then null;
    when others then
      update fleet.task set state = 'dead', wakes = null, ended = at,
        reasons = t.reasons || jsonb_build_object('start', t.starts, 'at', at, 'reason', sqlerrm)
      where task = t.task;
    end;
  end loop;
  delete from fleet.task where task in (
    select task from fleet.task where wakes <= at and state in ('done', 'cancelled')
    order by wakes, task limit 1000 for update skip locked);
  get diagnostics removed = row_count;
  select greatest(0, extract(epoch from wakes - at)) into next_in
  from fleet.task where wakes is not null and state in ('later', 'waiting', 'running') order by wakes limit 1;
  if removed = 1000 then next_in := 0; end if;
end $$;

-- Starts tasks of a queue that wait, and need nothing but these skills: one for each of the robots, as long as there
-- are some. (Of those whose deadline has passed, it lets a hundred die that are in its way.)
create function fleet.claim_waiting(a_queue text, some_robots text[], skills text[], a_term interval, a_request uuid)
returns table (task bigint, lease bigint, robot text, key text, input jsonb, start int) language plpgsql as $$
#variable_conflict use_column
declare
  at timestamptz := fleet.clock();
  -- Each set of needs once, however many tasks have it.
  kinds text[] := array(
    with recursive kinds as (
      (select needs from fleet.task where state = 'waiting' and queue = a_queue order by needs limit 1)
      union all
      select (select needs from fleet.task where state = 'waiting' and queue = a_queue and needs > kinds.needs
              order by needs limit 1)
      from kinds where kinds.needs is not null)
    select needs::text from kinds where needs <@ skills);
  expired int := 0;
  a_robot text;
  kind text;
  t fleet.task;
begin
  if cardinality(kinds) = 0 then return; end if;
  foreach a_robot in array some_robots loop
    loop
      t := null;
      -- (Mostly there is one.)
      if cardinality(kinds) > 1 then
        kinds := array(
          select kind.needs from unnest(kinds) kind (needs) cross join lateral (
            select priority, task from fleet.task f
            where state = 'waiting' and queue = a_queue and f.needs = kind.needs::text[]
            order by priority desc, task limit 1) first
          order by first.priority desc, first.task);
      end if;
      foreach kind in array kinds loop
        select * into t from fleet.task f where state = 'waiting' and queue = a_queue and f.needs = kind::text[]
          order by priority desc, task limit 1 for update skip locked;
        exit when found;
      end loop;
      exit when t.task is null or t.deadline is null or t.deadline > at;
      perform fleet.wake(t, at);
      expired := expired + 1;
      if expired = 100 then return; end if;
    end loop;
    exit when t.task is null;
    return query update fleet.task f set
      state = 'running', starts = t.starts + 1, lease = nextval('fleet.number'), robot = a_robot, term = a_term,
      request = a_request, wakes = fleet.clock() + a_term, progress = null
    where f.task = t.task returning f.task, f.lease, f.robot, f.key, f.input, f.starts;
    if t.is_watched then perform fleet.tell('task', t.task::text); end if;
  end loop;
end $$;

create function fleet.check_claim(a_queue text, some_robots text[], skills text[], a_term interval) returns void
language plpgsql as $$
begin
  perform fleet.require_epoch();
  perform fleet.check_robots(some_robots);
  if a_term is null or a_term not between interval '0.1 s' and interval '1 day' then
    perform fleet.refuse('FL002', 'a term has 0.1 seconds to 1 day');
  end if;
  if a_queue is null or skills is null then
    perform fleet.refuse('FL002', 'a robot claims of a queue, with its skills (which may be none)');
  end if;
end $$;

-- The same; if there are not enough, also of those that the clock has made due. If it is asked again, what it has
-- started before.
create function fleet.start_some(
  a_queue text, some_robots text[], skills text[], a_term interval, a_request uuid, is_again boolean
) returns table (task bigint, lease bigint, robot text, key text, input jsonb, start int) language plpgsql as $$
#variable_conflict use_column
declare
  served int;
begin
  if is_again then
    return query
      with held as (
        select f.task from fleet.task f
        where state = 'running' and request = a_request and wakes > fleet.clock() order by task for update),
      renewed as (
        update fleet.task f set wakes = fleet.clock() + term from held where f.task = held.task returning f.*)
      select r.task, r.lease, r.robot, r.key, r.input, r.starts from renewed r order by r.lease;
    if found then return; end if;
  end if;
  return query select * from fleet.claim_waiting(a_queue, some_robots, skills, a_term, a_request);
  get diagnostics served = row_count;
  if served < cardinality(some_robots) and exists (
      select from fleet.task where wakes <= fleet.clock() and state in ('later', 'waiting', 'running'))
      and (select swept from fleet.sweep()) > 0 then
    return query select * from fleet.claim_waiting(a_queue, some_robots[served + 1:], skills, a_term, a_request);
  end if;
end $$;

-- Starts tasks of a queue that need nothing but these skills: one for each of the robots, or as many as there are. A
-- client that does not know what it was answered asks again with the same request: then it has the same starts, if
-- there were some, from now for their term.
create function fleet.claim(
  a_queue text, some_robots text[], skills text[], a_term interval,
  a_request uuid default null, is_again boolean default false
) returns table (task bigint, lease bigint, robot text, key text, input jsonb, start int) language plpgsql as $$
begin
  perform fleet.check_claim(a_queue, some_robots, skills, a_term);
  return query select * from fleet.start_some(a_queue, some_robots, skills, a_term, a_request, is_again);
end $$;

-- Completes starts, and then starts tasks for robots that want others: fleet.complete_some and fleet.claim in one
-- statement. Of a completed start there are only the task and the lease.
create function fleet.complete_and_claim(
  some_tasks bigint[], some_leases bigint[], some_results jsonb[],
  a_queue text, some_robots text[], skills text[], a_term interval,
  a_request uuid default null, is_again boolean default false
) returns table (task bigint, lease bigint, robot text, key text, input jsonb, start int) language plpgsql as $$
begin
  perform fleet.check_claim(a_queue, some_robots, skills, a_term);
  return query select done.task, done.lease, null::text, null::text, null::jsonb, null::int
    from fleet.complete_some(some_tasks, some_leases, some_results) done;
  return query select * from fleet.start_some(a_queue, some_robots, skills, a_term, a_request, is_again);
end $$;

-- The task, locked, if that lease is the one of its start that runs; otherwise FL001.
create function fleet.running(a_task bigint, a_lease bigint) returns fleet.task language plpgsql as $$
declare
  t fleet.task;
begin
  perform fleet.require_epoch();
  select * into t from fleet.task where task = a_task and lease = a_lease and state = 'running' for update;
  if not found then
    perform fleet.refuse('FL001', format('the lease %s of the task %s is lost: it was started again, or has ended',
      a_lease, a_task));
  end if;
  return t;
end $$;

-- Of these starts, those that keep their leases, from now for their terms; and whether the task is to be cancelled.
-- (What has expired is lost, whether anyone has noticed that or not.)
create function fleet.renew(some_tasks bigint[], some_leases bigint[])
returns table (task bigint, lease bigint, is_cancelled boolean) language sql as $$
  select fleet.require_epoch();
  with held as (
    select t.task from fleet.task t join unnest(some_tasks, some_leases) as said (task, lease) using (task, lease)
    where t.state = 'running' and t.wakes > fleet.clock()
    order by t.task for update of t)
  update fleet.task t set wakes = fleet.clock() + t.term from held where t.task = held.task
  returning t.task, t.lease, t.is_cancelled
$$;

-- In the transaction of what the task has written: both are committed, or neither.
create function fleet.complete(a_task bigint, a_lease bigint, a_result jsonb) returns void language plpgsql as $$
begin
  perform fleet.close(fleet.running(a_task, a_lease), 'done', coalesce(a_result, 'null'), null);
end $$;

-- Of these starts, those that are completed now. (Those of which the lease is lost are not. Most tasks are not watched,
-- nor periodic: fleet.close of all of those is one statement.)
create function fleet.complete_some(some_tasks bigint[], some_leases bigint[], some_results jsonb[])
returns table (task bigint, lease bigint) language plpgsql as $$
#variable_conflict use_column
declare
  t record;
begin
  perform fleet.require_epoch();
  for t in
    with held as (
      select f.task, f.lease, not f.is_watched and f.period is null as is_plain, coalesce(said.result, 'null') as result
      from fleet.task f
        join unnest(some_tasks, some_leases, some_results) as said (task, lease, result) using (task, lease)
      where f.state = 'running' order by f.task for update of f),
    closed as (
      update fleet.task f set state = 'done', result = held.result, ended = at, wakes = at + f.kept
      from held, fleet.clock() at where f.task = held.task and held.is_plain)
    select * from held
  loop
    if not t.is_plain then
      perform fleet.close(f, 'done', t.result, null) from fleet.task f where f.task = t.task;
    end if;
    task := t.task;
    lease := t.lease;
    return next;
  end loop;
end $$;

-- The start has failed: the task comes back after a pause, or is dead.
create function fleet.fail(a_task bigint, a_lease bigint, why text) returns void language plpgsql as $$
begin
  perform fleet.start_ended(fleet.running(a_task, a_lease), why, true);
end $$;

-- A start that has not begun: it does not count.
create function fleet.give_back(a_task bigint, a_lease bigint) returns void language plpgsql as $$
begin
  perform fleet.start_ended(fleet.running(a_task, a_lease), 'given back', false);
end $$;

create function fleet.report(a_task bigint, a_lease bigint, a_progress jsonb) returns void language plpgsql as $$
declare
  t fleet.task := fleet.running(a_task, a_lease);
begin
  update fleet.task set progress = a_progress where task = a_task;
  if t.is_watched then perform fleet.tell('task', a_task::text); end if;
end $$;

-- What became of a start, for one who does not know whether its completion was committed: running, completed or lost.
-- (It waits for a transaction that completes it just now.)
create function fleet.became(a_task bigint, a_lease bigint) returns text language sql as $$
  select fleet.require_epoch();
  select coalesce((
    select case state when 'running' then 'running' when 'done' then 'completed' else 'lost' end
    from fleet.task where task = a_task and lease = a_lease for share), 'lost')
$$;

-- The number of a task; null if there is no such task. (Of periodic ones, of that which is to come or runs.)
create function fleet.number_of(a_queue text, a_key text) returns bigint language sql as $$
  select fleet.require_epoch();
  select task from fleet.find(a_queue, a_key, a_key)
$$;

-- The dead tasks of a queue, the oldest first.
create function fleet.list_dead(a_queue text, a_limit int default 1000)
returns table (task bigint, key text, starts int, reasons jsonb) language sql as $$
  select fleet.require_epoch();
  select task, key, starts, reasons from fleet.task where queue = a_queue and state = 'dead' order by task limit a_limit
$$;

-- A task, for those who have its number; from now on there is a notice of each change.
create function fleet.look(some_tasks bigint[])
returns table (task bigint, state fleet.state, starts int, progress jsonb, result jsonb, reasons jsonb)
language sql set lock_timeout = '250ms' as $$
  select fleet.require_epoch();
  -- (A robot that claims meanwhile skips a row that is locked: so it has to look again.)
  with watched as (
    update fleet.task set is_watched = true where task in (
      select task from fleet.task where task = any (some_tasks) and not is_watched order by task for update)
    returning queue, state)
  select fleet.tell('queue', queue) from watched where state = 'waiting';
  select task, state, starts, progress, result, reasons from fleet.task where task = any (some_tasks)
$$;

-- The state that it has then; null if there is no such task. One that runs is cancelled when its robot has stopped it,
-- or its lease has expired. (The key of periodic tasks is that of all: none is to come.)
create function fleet.cancel(a_queue text, a_key text) returns fleet.state language plpgsql as $$
declare
  t fleet.task;
begin
  perform fleet.require_epoch();
  t := fleet.find(a_queue, a_key, a_key);
  select * into t from fleet.task where task = t.task for update;
  if t.series is not null and t.state not in ('later', 'waiting', 'running') then
    -- (It has ended just now, and was followed by the next one.)
    t := fleet.find(a_queue, a_key, a_key);
    select * into t from fleet.task where task = t.task for update;
  end if;
  if t.state in ('later', 'waiting') then
    perform fleet.close(t, 'cancelled', null, null);
    return 'cancelled';
  elsif t.state = 'running' then
    update fleet.task set is_cancelled = true where task = t.task;
    perform fleet.tell('cancel', t.task::text);
  end if;
  return t.state;
end $$;

-- A dead task has all its starts again: whether there is such a task.
create function fleet.retry(a_queue text, a_key text) returns boolean language plpgsql as $$
begin
  perform fleet.require_epoch();
  -- (Of a periodic task, the next one has been submitted already.)
  update fleet.task set state = 'waiting', starts = 0, ended = null, wakes = null, deadline = null,
    series = null, period = null
  where queue = a_queue and key = a_key and state = 'dead';
  if found then perform fleet.tell('queue', a_queue); end if;
  return found;
exception when unique_violation then
  perform fleet.refuse('FL002', format('another task of the queue %L has the key %L now', a_queue, a_key));
end $$;

-- --- Resources ----------------------------------------------------------------------------------------------------

create table fleet.resource (
  resource text primary key,
  fence bigint,                     -- of the last holder
  request uuid,                     -- of the last holder
  robot text,                       -- of the last holder
  term interval not null,           -- of the last holder
  until timestamptz not null        -- free from then on
);

create index resource_request on fleet.resource (request);
create index resource_robot on fleet.resource (robot);

-- Requests that wait, in the order of their numbers.
create table fleet.place (
  place bigint generated always as identity primary key,
  request uuid not null unique,
  resources text[] not null,
  robot text not null,
  asked timestamptz not null,  -- last
  until timestamptz not null   -- who has not asked again by then waits no longer
);

create index place_resources on fleet.place using gin (resources);

-- All of these resources, or none of them. A request that is repeated (its answer may have been lost) has the same
-- place, and then the same fences. Without fences: when to ask again, in seconds, unless there is a notice before (see
-- release): turn with this request, or resource. After line, which is of another's turn, 0.25 s later, unless that
-- comes again; and in any case after 5 s. First come is first served; but who does not ask for 0.5 s, while all that it
-- waits for is free, is passed over.
create function fleet.hold(
  a_request uuid, some_resources text[], a_robot text, a_term interval,
  out resources text[], out fences bigint[], out again_in double precision
) language plpgsql set lock_timeout = '250ms' as $$
#variable_conflict use_column
declare
  names text[] := array(select distinct unnest(some_resources) order by 1);
  at timestamptz;
  free_at timestamptz;
  holds_others boolean;
  is_locked boolean;
  mine bigint;
  other fleet.place;
begin
  perform fleet.require_epoch();
  perform fleet.check_robots(array[a_robot]);
  if a_term is null or a_term not between interval '0.1 s' and interval '1 day' then
    perform fleet.refuse('FL002', 'a term has 0.1 seconds to 1 day');
  end if;
  if a_request is null then perform fleet.refuse('FL002', 'a request has a number of its own'); end if;
  if cardinality(names) = 0 then perform fleet.refuse('FL002', 'there is no resource to hold'); end if;
  if exists (select from unnest(names) name where name is null or length(name) not between 1 and 200) then
    perform fleet.refuse('FL002', 'the name of a resource has 1 to 200 characters');
  end if;
  -- (One that is there is not inserted, for that would wait for a transaction that changes it.)
  insert into fleet.resource (resource, term, until)
    select name, a_term, holds_from from unnest(names) name, fleet.about
    where not exists (select from fleet.resource where resource = name) order by name on conflict do nothing;
  -- First without locks, so that those who wait do not wait for each other; then, for what changes a resource, with.
  <<looking>>
  foreach is_locked in array array[false, true] loop
    if is_locked then perform from fleet.resource where resource = any (names) order by resource for update; end if;
    at := fleet.clock();
    if exists (
        select from fleet.resource where request = a_request and until > at
        having count(*) > 0 and array_agg(resource order by resource) <> names) then
      perform fleet.refuse('FL002', 'a request that holds other resources already has another number');
    end if;
    if (select bool_and(request is not distinct from a_request and until > at)
        from fleet.resource where resource = any (names)) then
      continue when not is_locked;
      update fleet.resource set until = at + a_term, term = a_term where resource = any (names);
      resources := names;
      fences := array(select fence from fleet.resource where resource = any (names) order by resource);
      return;
    end if;
    select place into mine from fleet.place where request = a_request;
    select max(until) into free_at from fleet.resource where resource = any (names);
    if free_at > at then
      again_in := least(5, extract(epoch from free_at - at));
      exit;
    end if;
    holds_others := exists (select from fleet.resource where robot = a_robot and until > at);
    for other in
      select * from fleet.place
      where resources && names and until > at and (mine is null or place < mine) order by place
    loop
      select max(until) into free_at from fleet.resource where resource = any (other.resources);
      -- (A robot that holds something waits for none whose turn it is not: that one may wait for it, in a circle.)
      continue when holds_others and (free_at > at or exists (
        select from fleet.place first
        where first.place < other.place and first.until > at and first.resources && other.resources));
      if at < greatest(free_at, other.asked) + interval '0.5 s' then
        again_in := least(0.25, extract(epoch from greatest(free_at, other.asked) + interval '0.5 s' - at));
        exit looking;
      end if;
      continue looking when not is_locked;
      -- (Once is enough, until it asks again; which it may do just now.)
      update fleet.place set until = at where place = other.place and asked = other.asked;
      if not found then
        again_in := 0.25;
        exit looking;
      end if;
    end loop;
  end loop;
  if again_in is not null then
    insert into fleet.place (request, resources, robot, asked, until)
      values (a_request, names, a_robot, at, at + interval '10 s')
      on conflict (request) do update set resources = names, asked = at, until = at + interval '10 s';
    return;
  end if;
  delete from fleet.place where request = a_request;
  update fleet.resource r set
    fence = numbered.fence, request = a_request, robot = a_robot, term = a_term, until = at + a_term
  from (select name, nextval('fleet.number') as fence from unnest(names) name) as numbered where resource = name;
  resources := names;
  fences := array(select fence from fleet.resource where resource = any (names) order by resource);
exception when lock_not_available then
  -- (By a transaction that has not ended: no function here takes so long.)
  again_in := 0.25;
end $$;

-- Of these requests, those that keep what they hold, from now for their terms. (What has expired is lost, whether
-- anyone has noticed that or not.)
create function fleet.keep(some_requests uuid[]) returns setof uuid language plpgsql set lock_timeout = '250ms' as $$
declare
  at timestamptz;
begin
  perform fleet.require_epoch();
  perform from fleet.resource where request = any (some_requests) order by resource for update;
  at := fleet.clock();
  return query
    with renewed as (
      update fleet.resource set until = at + term where request = any (some_requests) and until > at returning request)
    select distinct request from renewed;
end $$;

-- The request holds nothing, and waits for nothing. Of each resource that is free then a notice says whose turn it is:
-- turn REQUEST and line NAME, of the first that can have all that it waits for; or resource NAME, if there is none (one
-- may have come just now).
create function fleet.release(a_request uuid) returns void language plpgsql set lock_timeout = '250ms' as $$
declare
  at timestamptz;
  names text[];
  name text;
  next_in_line uuid;
begin
  delete from fleet.place where request = a_request returning resources into names;
  perform from fleet.resource where request = a_request order by resource for update;
  at := fleet.clock();
  with freed as (
    update fleet.resource set until = at, request = null where request = a_request and until > at returning resource)
  select names || array_agg(resource) into names from freed;
  for name in select distinct unnest(names) loop
    continue when exists (select from fleet.resource where resource = name and until > at);
    select request into next_in_line from fleet.place p
      where array[name] <@ p.resources and p.until > at
        and not exists (select from fleet.resource r where r.resource = any (p.resources) and r.until > at)
      order by place limit 1;
    if found then
      perform fleet.tell('turn', next_in_line::text), fleet.tell('line', name);
    else
      perform fleet.tell('resource', name);
    end if;
  end loop;
end $$;

-- --- Processes ----------------------------------------------------------------------------------------------------

create table fleet.process (
  process uuid primary key,
  host text not null,
  page text,                       -- the address of its live page
  robots text[] not null,
  seen timestamptz not null,
  poll interval not null           -- how often it is seen
);

-- To be called every few seconds, and when a task is due: the process runs these robots. (Its host is by default what
-- the database knows of it.) Sweeps; then, when the next task is due, and the queues in which tasks wait.
create function fleet.poll(
  a_process uuid, a_host text, a_page text, some_robots text[], a_poll interval,
  out next_in double precision, out waiting text[]
) language plpgsql as $$
declare
  at timestamptz := fleet.clock();
  to_forget boolean;
  to_remove boolean;
begin
  perform fleet.require_epoch();
  perform fleet.check_robots(some_robots);
  if a_process is null or (a_poll between interval '0' and interval '1 day') is not true then
    perform fleet.refuse('FL002', 'a process has a number of its own, and polls every 0 seconds to 1 day');
  end if;
  insert into fleet.process (process, host, page, robots, seen, poll)
    values (a_process, coalesce(a_host, host(inet_client_addr()), 'on the machine of the database'), a_page,
      some_robots, at, a_poll)
    on conflict (process) do update set page = excluded.page, robots = excluded.robots, seen = excluded.seen;
  -- (One look, for mostly nothing is to be done.)
  select
    (select extract(epoch from wakes - at) from fleet.task
      where wakes is not null and state in ('later', 'waiting', 'running') order by wakes limit 1),
    exists (select from fleet.task where wakes <= at and state in ('done', 'cancelled')),
    exists (select from fleet.process where seen < at - interval '1 day')
      or exists (select from fleet.place where until < at - interval '1 min')
    into next_in, to_forget, to_remove;
  if next_in <= 0 or to_forget then
    select s.next_in into next_in from fleet.sweep() s;
  end if;
  if to_remove then
    delete from fleet.process where process in (
      select process from fleet.process where seen < at - interval '1 day' for update skip locked);
    delete from fleet.place where place in (
      select place from fleet.place where until < at - interval '1 min' for update skip locked);
  end if;
  waiting := array(
    with recursive queues as (
      (select queue from fleet.task where state = 'waiting' order by queue limit 1)
      union all
      select (select queue from fleet.task where state = 'waiting' and queue > queues.queue order by queue limit 1)
      from queues where queue is not null)
    select queue from queues where queue is not null);
end $$;

-- The process has ended.
create function fleet.leave(a_process uuid) returns void language sql as $$
  delete from fleet.process where process = a_process
$$;

-- --- A database that was restored ---------------------------------------------------------------------------------

-- After the database was restored from a copy: no number is given out that may have been given out before, of tasks,
-- leases and fences; no start runs; and no resource is free before that term is over, or the longest one that is known.
-- (Of robots that hold one of the other database.)
create function fleet.new_epoch(a_term interval default '1 min') returns bigint language plpgsql as $$
declare
  new bigint;
  t fleet.task;
begin
  if (a_term between interval '0' and interval '1 day') is not true then
    perform fleet.refuse('FL002', 'a term has 0 seconds to 1 day');
  end if;
  select greatest(a.epoch + 1, a.seen / 1000000 + 1, (select last_value from fleet.number) / 1000000 + 1,
    fleet.epoch_at(fleet.clock()))
    into new from fleet.about a for update;
  update fleet.about set epoch = new, origin = fleet.origin(), home = 'fleet.about'::regclass::oid, is_restored = false,
    holds_from = fleet.clock() + greatest(a_term, (select max(term) from fleet.resource));
  perform setval('fleet.number', new * 1000000 - 1);
  perform setval(pg_get_serial_sequence('fleet.task', 'task'), new * 1000000 - 1);
  for t in select * from fleet.task where state = 'running' order by task for update loop
    perform fleet.start_ended(t, 'the database was restored from a copy', false);
  end loop;
  delete from fleet.place;
  update fleet.resource set until = holds_from, request = null from fleet.about;
  return new;
end $$;

-- --- Sight --------------------------------------------------------------------------------------------------------

create view fleet.queues as
  select queue, state, count(*) as tasks, min(due) as oldest from fleet.task group by queue, state;

create view fleet.to_start as
  select queue, key, task, state, priority, needs, due, wakes, deadline, starts
  from fleet.task where state in ('later', 'waiting');

create view fleet.starts as
  select queue, key, task, lease, robot, starts, progress, wakes - fleet.clock() as expires_in
  from fleet.task where state = 'running';

create view fleet.dead as
  select queue, key, task, starts, ended, reasons from fleet.task where state = 'dead';

create view fleet.holds as
  select resource, robot, fence, until - fleet.clock() as expires_in from fleet.resource where until > fleet.clock();

create view fleet.waits as
  select place, robot, resources, asked from fleet.place where until > fleet.clock();

create view fleet.processes as
  select process, host, page, robots, seen, seen + 3 * poll > fleet.clock() as is_there from fleet.process;

-- --- Its first epoch ----------------------------------------------------------------------------------------------

insert into fleet.about (version, epoch, origin, home)
values (1, fleet.epoch_at(fleet.clock()), fleet.origin(), 'fleet.about'::regclass::oid);
select setval('fleet.number', epoch * 1000000 - 1) from fleet.about;
