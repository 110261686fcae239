-- The rights of each version of the schema. (A dump that is restored on another server may find no roles there:
-- so the roles are made, and this is done, whenever the schema is migrated.)

-- Functions run with the rights of their owner, so robots need no right to a table. A day has 24 hours in them. (Their
-- statements are planned once in a session: by itself PostgreSQL plans each again for its first five calls, and those
-- with arrays for all.)
do $$
declare
  f record;
begin
  for f in select oid::regprocedure as name, proname from pg_proc where pronamespace = 'fleet'::regnamespace loop
    execute format('revoke all on function %s from public', f.name);
    if f.proname = any ('{connect,submit,claim,renew,complete,complete_some,complete_and_claim,fail,give_back,report,
        became,number_of,list_dead,look,cancel,retry,hold,keep,release,poll,leave,sweep}') then
      execute format('alter function %s security definer set search_path = fleet, pg_catalog, pg_temp', f.name);
      execute format('alter function %s set timezone = ''UTC''', f.name);
      execute format('alter function %s set plan_cache_mode = force_generic_plan', f.name);
      execute format('grant execute on function %s to fleet_robot', f.name);
    end if;
  end loop;
end $$;

grant usage on schema fleet to fleet_robot, fleet_viewer;
grant execute on function fleet.clock() to fleet_robot, fleet_viewer;
grant execute on function fleet.origin() to fleet_viewer;
grant select on fleet.about, fleet.queues, fleet.to_start, fleet.starts, fleet.dead, fleet.holds, fleet.waits,
  fleet.processes to fleet_viewer;
